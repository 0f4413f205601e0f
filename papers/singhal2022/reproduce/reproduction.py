"""The contents of the report: results of each part, settings of the runs, and the machine."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gridpeers.benchmarks import Findings, Verdict
from gridpeers.output_folders import versions
from gridpeers.papers.singhal2022.paper_benchmarks import ComparedNumber, numbers
from gridpeers.papers.singhal2022.reproduce.parts import Part, Picture
from gridpeers.papers.singhal2022.tables import Cell, PaperTable
from gridpeers.papers.singhal2022.topology_claims import graph_runs


@dataclass(frozen=True, kw_only=True)
class PartResult:
    """Findings, verdicts and files of one part."""

    part: Part
    found: Findings
    verdicts: Sequence[Verdict]
    tables: tuple[PaperTable, ...]
    figures: Mapping[Picture, Path]
    """Image of each of its figures that the report shows."""
    sha256: Mapping[str, str]
    """Hash of each case's history.csv, by case."""
    metrics: Any
    """Contents of its metrics.json; None for the topologies."""
    wall_s: float
    """How long it took (s)."""
    cpu_s: float
    """Processor time that it took, of all processes (s)."""

    def verdicts_beside(self, figure: str) -> list[Verdict]:
        """Return the verdicts to show below a figure, by its key; "" for those of claims without a shown figure."""
        figured = {picture.key for picture in self.figures}
        shown = [(one.claim.figure if one.claim.figure in figured else "", one) for one in self.verdicts]
        return [verdict for key, verdict in shown if key == figure]


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """All contents of the report."""

    results: tuple[PartResult, ...]
    driver: str
    seed: int
    started: str
    """Date and time."""
    only: str
    """Value of `--only`, or ""."""

    @property
    def verdicts(self) -> list[Verdict]:
        """All verdicts."""
        return [verdict for result in self.results for verdict in result.verdicts]

    @property
    def wall_s(self) -> float:
        """How long all took (s)."""
        return sum(result.wall_s for result in self.results)

    @property
    def cpu_s(self) -> float:
        """Processor time of all (s)."""
        return sum(result.cpu_s for result in self.results)

    @property
    def failed(self) -> bool:
        """Whether a claim failed that is no known miss. A number out of its tolerance fails the claim on its column."""
        return any(verdict.status == "FAIL" for verdict in self.verdicts)

    def counts(self) -> dict[str, int]:
        """Return how many claims have which status."""
        statuses = [verdict.status for verdict in self.verdicts]
        return {status: statuses.count(status) for status in dict.fromkeys(("PASS", "FAIL", "MISS", *statuses))}

    @property
    def numbers(self) -> list[ComparedNumber]:
        """All numbers of the tables, ours beside the paper's."""
        return [number for result in self.results for number in numbers(result.found, result.tables)]

    @property
    def claims(self) -> str:
        """How many claims hold, in words."""
        counts = self.counts()
        held = f"{counts['PASS']} of {len(self.verdicts)} claims hold, {counts['MISS']} missed for a known reason"
        return f"{held}, {counts['FAIL']} failed."


def machine() -> str:
    """Return processor, its cores that may be used, memory and system."""
    cpu = platform.processor() or platform.machine()
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        cpu = next(line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return f"{cpu}, {cores} core{'s' if cores > 1 else ''}; {platform.system()} {platform.release()}"


def metrics_json(whole: Reproduction) -> str:
    """Return the text of metrics.json: every number of the tables beside the paper's, every verdict, every measure."""
    tables = [
        {
            "table": cell.table,
            "case": cell.case,
            "event": cell.event,
            "island": cell.island,
            "quantity": cell.quantity,
            "paper": cell.paper,
            "ours": _ours(result, cell),
            **({"reason": reason} if (reason := result.found.reason(cell)) else {}),
            "tolerance": cell.tolerance.value,
            "within": result.found.within(cell),
            "within_relative": cell.within_relative(ours) if (ours := _ours(result, cell)) is not None else None,
            "within_factor": cell.within_factor(ours) if ours is not None else None,
        }
        for result in whole.results
        for table in result.tables
        for cell in table.cells
    ]
    claims = [
        {
            "part": result.part.name,
            "claim": verdict.claim.name,
            "text": verdict.claim.text,
            "source": verdict.claim.source,
            "status": verdict.status,
            "found": verdict.found,
            "reason": verdict.claim.known_miss if verdict.status == "MISS" else "",
        }
        for result in whole.results
        for verdict in result.verdicts
    ]
    document = {
        "driver": whole.driver,
        "seed": whole.seed,
        "started": whole.started,
        "machine": machine(),
        "versions": versions(),
        "times_s": {result.part.name: {"wall": result.wall_s, "cpu": result.cpu_s} for result in whole.results},
        "tables": tables,
        "claims": claims,
        "runs": {result.part.name: result.metrics for result in whole.results if result.metrics},
        "topology": [
            {
                "links": run.links,
                "connected": run.connected,
                **asdict(run.settled),
                **{"MPSI": run.steady.MPSI, "f_error_Hz": run.steady.f_error_Hz},
            }
            for result in whole.results
            for run in graph_runs(result.found)
        ],
    }
    return json.dumps(_plain(document), indent=2, allow_nan=False) + "\n"


def _ours(result: PartResult, cell: Cell) -> float | None:
    """Return our number at the place of the paper's; None where it is not steady."""
    return None if result.found.reason(cell) else result.found.value(cell)


def _plain(value: Any) -> Any:
    """Return the same with null in place of nan."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and value != value else value
