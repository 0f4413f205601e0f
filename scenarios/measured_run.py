"""From the recorded cases of a run to its measures: metrics.json, checks.json and report.txt in its folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from gridpeers.scenarios.checks.check_verdict import FILE, verdicts_json
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.checks.judging import judge_case
from gridpeers.scenarios.results.claims import NO_BENCHMARK, benchmark_of, judge, judged
from gridpeers.scenarios.results.findings import find
from gridpeers.scenarios.results.metrics_file import RunMetrics, metrics_json
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.scenarios.results.report import RunReport, plain
from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.scenarios.schema.plugin_keys import claims_of


def write_measures(
    run: RunMetrics,
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
