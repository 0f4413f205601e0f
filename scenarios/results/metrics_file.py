"""metrics.json: the measures of a run, whoever ran it, as a file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import msgspec

from plant.equipment import Feeder
from scenarios.results.findings import SHARED, Findings
from scenarios.results.steadiness import BOUNDS
from scenarios.schema import ScenarioModel
from wire.messages import Pacing

Clock = Literal["simulated", "wall"]
"""Lock-step of plant and agents, or real time."""


@dataclass(frozen=True, kw_only=True)
class RunMetrics:
    """What was run, and how."""

    scenario: ScenarioModel
    """Checked; with the seed and the cases asked for."""
    feeder: Feeder
    """Its feeder."""
    driver: str
    """What moved bytes and time: "processes", "inprocess", or "by hand"."""
    folder: Path
    """Its run folder."""
    clock: Clock = "simulated"
    speed: float = 1.0
    """Wall-clock: run time per wall time (s/s)."""


def metrics_json(
    ran: RunMetrics,
    found: Findings,
    sha256: Mapping[str, str],
    pacing: Mapping[str, Pacing],
    links_sha256: Mapping[str, str] = MappingProxyType({}),
    by_hand: Mapping[str, Any] = MappingProxyType({}),
    unlike: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    saved: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
) -> str:
    """Text of metrics.json; what is not a number (nothing to share, or nobody to share it with) or not steady is null.

    Pacing is in s of wall time.

    Parameters
    ----------
    ran : RunMetrics
        What was run.
    found : Findings
        What was measured.
    sha256, pacing, links_sha256 : Mapping
        By case: hash of its history, how it kept real time, hash of all fates of messages; where there are any.
    by_hand : Mapping[str, Any], optional
        What a reader must know of a run that people had their hands in.
    unlike : Mapping[str, Mapping[str, Any]], optional
        By case: where a run in wall-clock time was not what its scenario says.
    saved : Mapping[str, Mapping[str, float]], optional
        By case and event: share of states that neighbours were not told of, where there are any.
    """
    cases: dict[str, dict[str, Any]] = {}
    for case, steady in found.results.items():
        cases[case] = {label: _numbers(asdict(values)) for label, values in steady.items()}
        for label, share in saved.get(case, {}).items():
            cases[case][label]["messages_saved"] = share
        for label, islands in found.islands.get(case, {}).items():
            cases[case][label] |= dict.fromkeys(SHARED)
            cases[case][label].get("reasons", {}).pop("MPSI", None)
            cases[case][label].get("reasons", {}).pop("MQSI", None)
            cases[case][label]["islands"] = {name: _numbers(asdict(values)) for name, values in islands.items()}
        for label, measured in found.own.get(case, {}).items():
            if label in cases[case]:
                cases[case][label] |= measured.values
                if measured.reasons:
                    cases[case][label].setdefault("reasons", {}).update(measured.reasons)
        if case in found.without_agent:
            cases[case]["without_agent"] = list(found.without_agent[case])
        cases[case]["history_sha256"] = sha256[case]
        if case in links_sha256:
            cases[case]["links_sha256"] = links_sha256[case]
        cases[case] |= unlike.get(case, {})
        if case in pacing:
            cases[case]["pacing"] = msgspec.to_builtins(pacing[case])
    scenario = ran.scenario
    clock = {"clock": ran.clock, "speed": ran.speed} if ran.clock == "wall" else {}
    hand = {"by_hand": dict(by_hand)} if by_hand else {}
    whole = {"scenario": scenario.name, "seed": scenario.seed, "driver": ran.driver, **clock, **hand, "cases": cases}
    return json.dumps(whole, indent=2, allow_nan=False) + "\n"


def _numbers(steady: dict[str, Any]) -> dict[str, Any]:
    reasons: Mapping[str, str] = steady["reasons"]
    found: dict[str, Any] = {
        name: value if value is not None and math.isfinite(value) and name not in reasons else None
        for name, value in steady.items()
        if name not in ("p", "reasons")
    }
    told = {name: f"{text}{_last_mean(name, steady)}" for name, text in reasons.items()}
    return found | ({"reasons": told} if told else {})


def _last_mean(name: str, steady: Mapping[str, Any]) -> str:
    """Return what the last 0.2 s came to, for a measure that is a number without being steady."""
    value = steady[name]
    if not isinstance(value, float) or not math.isfinite(value):
        return ""
    return f"; last mean {value:.4g} {BOUNDS[name].unit}".rstrip()
