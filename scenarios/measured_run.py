"""From the recorded cases of a run to its measures: metrics.json, checks.json and report.txt in its folder."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from types import MappingProxyType
from typing import Any

import msgspec

from gridpeers.scenarios.checks.check_verdict import FILE, verdicts_json
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.checks.judging import judge_case
from gridpeers.scenarios.results.claims import NO_BENCHMARK, benchmark_of, judge, judged
from gridpeers.scenarios.results.findings import Findings, find
from gridpeers.scenarios.results.metric import UNITS
from gridpeers.scenarios.results.metrics import SHARING_OF_ISLANDS, Steady
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.scenarios.results.report import RunReport, plain
from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema.plugin_keys import claims_of
from gridpeers.wire.messages import Pacing


def write_measures(
    run: Request,
    cases: Mapping[str, CheckedCase],
    facts: Mapping[str, Mapping[str, Any]],
    notes: Sequence[str],
    *,
    place: str,
    disturbed: bool = False,
    live: Mapping[str, Any] = MappingProxyType({}),
    claims: bool = False,
) -> RunReport:
    """Measure and judge the cases, and write the files.

    `facts` and `live` are further entries of metrics.json, `place` is the folder as the report names it. A run that was
    `disturbed` has no published numbers beside its own; of others `claims` says whether they are judged.
    """
    scenario, findings = run.scenario, find(cases)
    benchmark, own = (NO_BENCHMARK, []) if disturbed else (benchmark_of(scenario.paper), claims_of(scenario))
    write_whole(run.folder / "metrics.json", metrics_json(run, findings, facts, live))
    checks = {name: judge_case(case) for name, case in cases.items()}
    write_whole(run.folder / FILE, verdicts_json(checks))
    report = RunReport(
        scenario=scenario.name,
        titles={case: rule.title for case, rule in scenario.cases.items()},
        findings=findings,
        verdicts=(*judge(findings, benchmark.claims), *judged(findings, own)) if claims else (),
        benchmark=benchmark,
        checks=checks,
        failures={name: law_failures(case.events) for name, case in cases.items()},
        notes=notes,
        folder=place,
    )
    write_whole(run.folder / "report.txt", plain(report))
    return report


def case_facts(recorded: Recorded, pacing: Pacing | None = None, **more: Any) -> dict[str, Any]:
    """Return the other entries of a case in metrics.json: hashes, `more`, and the pacing (s of wall time)."""
    links = {"links_sha256": recorded.links.sha256} if recorded.links.sha256 else {}
    paced = {} if pacing is None else {"pacing": msgspec.to_builtins(pacing)}
    return {"history_sha256": recorded.sha256} | links | more | paced


def metrics_json(
    run: Request,
    findings: Findings,
    facts: Mapping[str, Mapping[str, Any]],
    live: Mapping[str, Any] = MappingProxyType({}),
) -> str:
    """Return the text of metrics.json; a measure that is no number or not steady is null."""
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
