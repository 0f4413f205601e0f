"""metrics.json: the measures of a run, live or not, as a file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.results.metric import UNITS
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.wire.messages import Pacing

if TYPE_CHECKING:
    from gridpeers.scenarios.results.findings import Findings
    from gridpeers.scenarios.results.metrics import Steady

Clock = Literal["simulated", "wall"]  # Lock-step of plant and agents, or real time


@dataclass(frozen=True, kw_only=True)
class RunMetrics:
    """The run of which metrics.json has the measures."""

    scenario: ScenarioModel
    """Checked; with the seed and the cases asked for."""
    feeder: Tables
    driver: str
    """Driver of the run: "processes", "inprocess", or "live"."""
    folder: Path
    clock: Clock = "simulated"
    speed: float = 1.0
    """Real time: run time per wall time (s/s)."""


def case_facts(recorded: Recorded, pacing: Pacing | None = None, **more: Any) -> dict[str, Any]:
    """Return the other entries of a case in metrics.json: hashes, `more`, and the pacing (s of wall time)."""
    links = {"links_sha256": recorded.links.sha256} if recorded.links.sha256 else {}
    paced = {} if pacing is None else {"pacing": msgspec.to_builtins(pacing)}
    return {"history_sha256": recorded.sha256} | links | more | paced


def metrics_json(
    run: RunMetrics,
    findings: Findings,
    facts: Mapping[str, Mapping[str, Any]],
    live: Mapping[str, Any] = MappingProxyType({}),
) -> str:
    """Return the text of metrics.json; a measure that is no number or not steady is null."""
    from gridpeers.scenarios.results.metrics import SHARING_OF_ISLANDS  # numpy, which a run starts without

    cases: dict[str, dict[str, Any]] = {}
    for case, steady in findings.results.items():
        cases[case] = {label: _numbers(values) for label, values in steady.items()}
        for label, share in findings.messages_saved.get(case, {}).items():
            cases[case][label]["messages_saved"] = share
        for label, islands in findings.islands.get(case, {}).items():
            whole = cases[case][label]
            whole |= dict.fromkeys(SHARING_OF_ISLANDS)
            for name in SHARING_OF_ISLANDS:
                whole.get("reasons", {}).pop(name, None)
            whole["islands"] = {name: _numbers(values) for name, values in islands.items()}
        for label, measured in findings.own.get(case, {}).items():
            cases[case][label] |= measured.values
            if measured.reasons:
                cases[case][label].setdefault("reasons", {}).update(measured.reasons)
        if case in findings.without_agent:
            cases[case]["without_agent"] = list(findings.without_agent[case])
        cases[case] |= facts[case]
    scenario = run.scenario
    clock = {"clock": run.clock, "speed": run.speed} if run.clock == "wall" else {}
    table = {"live": dict(live)} if live else {}
    text = {"scenario": scenario.name, "seed": scenario.seed, "driver": run.driver, **clock, **table, "cases": cases}
    return json.dumps(text, indent=2, allow_nan=False) + "\n"


def _numbers(steady: Steady) -> dict[str, Any]:
    """Return the measures; one that is no number, or not steady, is None. Reasons name the mean of the last 0.2 s."""
    numbers: dict[str, Any] = {}
    reasons = dict[str, str]()
    for name, value in asdict(steady).items():
        finite = isinstance(value, float) and math.isfinite(value)
        if name in steady.reasons:
            reasons[name] = steady.reasons[name] + (f"; last mean {value:.4g}{UNITS[name]}" if finite else "")
        if name not in ("p", "reasons"):
            numbers[name] = value if finite and name not in steady.reasons else None
    return numbers | ({"reasons": reasons} if reasons else {})
