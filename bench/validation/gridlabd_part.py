"""Part (b): the whole plant beside GridLAB-D, at the same step."""

from __future__ import annotations

from bench.validation.gridlabd.both_plants import QUANTITIES, compare
from bench.validation.gridlabd.compared_runs import RUNS, SHORT
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart

ANGLE_LIMIT = 0.1
"""How far (deg) from its angle a switch may close: a step shifts it by as much."""


def _run(case: str, factor: float = 1.0) -> CaseResult:
    run = RUNS[case]
    compared = compare(run, factor)
    checks = [
        ToleranceCheck(f"{quantity}, {unit}", float(compared.differences[quantity].max()), run.tolerance)
        for quantity, unit in QUANTITIES.items()
    ]
    facts = {"closed at": ""}
    if run.reclosing and compared.angles:
        off = max(abs(angle - run.reclosing.angle) for angle in compared.angles)
        checks.append(ToleranceCheck("angle, deg", off, ANGLE_LIMIT))
        facts["closed at"] = f"-{compared.angles[0]:.2f} deg, GridLAB-D -{compared.angles[1]:.2f} deg"
    return CaseResult(case, tuple(checks), facts)


GRIDLABD = ValidationPart(
    "gridlabd",
    ("gridlabd",),
    {name: run.text for name, run in RUNS.items()},
    _run,
    run_short=lambda case: _run(case, SHORT),
)
