"""From the recorded cases of a run to its measures: metrics.json, checks.json and report.txt in its folder."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import msgspec

from gridpeers.scenarios.checks.check_verdict import FILE, judge_case, verdicts_json
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.console import in_order
from gridpeers.scenarios.results.claims import NO_BENCHMARK, benchmark_of, claim_of, judge
from gridpeers.scenarios.results.findings import Findings, find
from gridpeers.scenarios.results.history import late_moves
from gridpeers.scenarios.results.metric import UNITS
from gridpeers.scenarios.results.metrics import SHARING_OF_ISLANDS, Steady
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.scenarios.results.report import RunReport, plain
from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema.participants import without_agent
from gridpeers.scenarios.schema.plugin_keys import claims_of
from gridpeers.wire.messages import Pacing
from gridpeers.wire.wording import counted


def write_measures(
    run: Request,
    recorded: Mapping[str, Recorded],
    pacing: Mapping[str, Pacing],
    notes: Sequence[str],
    *,
    place: str,
    claims: bool = False,
) -> tuple[RunReport, dict[str, CheckedCase]]:
    """Measure and judge the cases, and write the files; return the report, and the cases, as figures take them.

    `place` is the folder as the report names it. Where people changed the run, or rows are missing, no published
    numbers stand beside the own; of other runs `claims` says whether they are judged.
    """
    scenario = run.scenario
    cases = {
        name: CheckedCase.of(scenario, run.feeder, name, record, run.folder / name) for name, record in recorded.items()
    }
    findings, facts = find(cases), {name: _facts(cases[name], record) for name, record in recorded.items()}
    for name, pace in pacing.items():
        facts[name]["pacing"] = msgspec.to_builtins(pace)
    changed = any({"commands", "missing"} & of.keys() for of in facts.values())
    benchmark, own = (NO_BENCHMARK, []) if changed else (benchmark_of(scenario.paper), claims_of(scenario))
    write_whole(run.folder / "metrics.json", metrics_json(run, findings, facts))
    checks = {name: judge_case(case) for name, case in cases.items()}
    write_whole(run.folder / FILE, verdicts_json(checks))
    told = [
        f"case {name}: {note}"
        for name, record in recorded.items()
        for note in _notes(cases[name], record, realtime=run.clock == "realtime")
    ]
    report = RunReport(
        scenario=scenario.name,
        titles={case: rule.title for case, rule in scenario.cases.items()},
        findings=findings,
        verdicts=judge(findings, (*benchmark.claims, *map(claim_of, own))) if claims else (),
        benchmark=benchmark,
        checks=checks,
        expected={case: rule.expected_failures for case, rule in scenario.cases.items()},
        failures={name: law_failures(case.events) for name, case in cases.items()},
        notes=[*notes, *told],
        folder=place,
    )
    write_whole(run.folder / "report.txt", plain(report))
    return report, cases


def _facts(case: CheckedCase, recorded: Recorded) -> dict[str, Any]:
    """Return the other entries of a case in metrics.json; but for the hashes only those that there are."""
    facts = {
        "links_sha256": recorded.links.sha256,
        "commands": sum(event.kind == "command" for event in recorded.events),
        "unmeasured": case.unmeasured,
        "missing": [{"after_s": a, "before_s": b} for a, b in recorded.missing],
    }
    return {"history_sha256": recorded.sha256} | {name: value for name, value in facts.items() if value}


def _notes(case: CheckedCase, recorded: Recorded, *, realtime: bool) -> Iterator[str]:
    """Yield sentences on what the scenario does not have, and on what of it is not measured."""
    ended, end_s = recorded.ended, case.scenario.time.end_s
    if realtime and not case.scenario.events:
        yield "the scenario has no event, so there is nothing to measure"
    if ended > end_s + 1e-9:
        yield f"measured up to {end_s:g} s, the end of the scenario; the history goes on to {ended:.2f} s"
    elif ended < end_s - 1e-9:
        yield f"ended at {ended:.2f} s of {end_s:g} s; the measures end there"
    if case.unmeasured:
        yield f"no numbers for {', '.join(case.unmeasured)}: not reached, too short, or without rows"
    if recorded.missing:
        spans = ", ".join(f"{before:.2f} and {after:.2f} s" for before, after in recorded.missing)
        yield f"rows are missing between {spans}: the plant did not reach the recorder"
    if names := in_order(without_agent(case.scenario, case.case)):
        yield f"{', '.join(names)} without an agent: MPSI, MQSI and the time to restore leave them out"
    yield from late_moves(case.scenario, recorded.events)
    if commands := [event.text for event in recorded.events if event.kind == "command"]:
        count = counted(len(commands), "command")
        yield f"people gave {count} (events.csv), first: {commands[0]}"
    if realtime and (moves := [each for each in recorded.events if each.kind == "roster" and each.t > 0.0]):
        times = counted(len(moves), "time")
        yield f"agents joined, left or were silent {times} (events.csv), first: {moves[0].text}"
    if shares := case.messages_saved:
        text = ", ".join(f"{100.0 * share:.0f} % in {window}" for window, share in shares.items())
        yield f"states not sent to neighbours: {text}"


def metrics_json(run: Request, findings: Findings, facts: Mapping[str, Mapping[str, Any]]) -> str:
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
    clock = {"clock": run.clock, "speed": run.speed} if run.clock == "realtime" else {}
    text = {"scenario": scenario.name, "seed": scenario.seed, "driver": run.driver, **clock, "cases": cases}
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
