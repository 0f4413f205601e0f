"""What a publication says of an experiment, and how a run is judged by it.

A scenario names a benchmark in its key `paper`, by a registered name or as "module:Name" (docs/results.md).
"""

from __future__ import annotations

from gridpeers.scenarios.results.claims import (
    BENCHMARKS,
    Benchmark,
    Claim,
    Judge,
    Published,
    Verdict,
    benchmark_of,
    judge,
)
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.metric import DIGITS, HEADINGS, UNITS, Quantity, label
from gridpeers.scenarios.results.metrics import F_BAND, MPSI_BAND, Settling, Steady

__all__ = [
    "BENCHMARKS",
    "DIGITS",
    "F_BAND",
    "HEADINGS",
    "MPSI_BAND",
    "UNITS",
    "Benchmark",
    "Claim",
    "Findings",
    "Judge",
    "Published",
    "Quantity",
    "Settling",
    "Steady",
    "Verdict",
    "benchmark_of",
    "judge",
    "label",
]
