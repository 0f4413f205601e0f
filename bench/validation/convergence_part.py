"""Part (e): how the plant's error falls with its step, in both methods of time stepping."""

from __future__ import annotations

import numpy as np

from bench.validation.convergence.step_errors import STEPS, step_errors
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart, rounded_up
from plant.plant_config import Method

END, SHORT = 0.9, 0.3
"""Durations (s) of the page's and the tests' runs: both events, or the islanding alone."""

LEAST_ORDER = {"first-order": 0.8, "second-order": 1.7}
"""Least observed order of every quantity."""

ORDER_AT = {"first-order": (4, 5), "second-order": (2, 3)}
"""Places in `STEPS` that the order is taken between: small, but above the error of the reference in either method."""

AT_2_MS, AT_QUARTER, SMALLEST = STEPS.index(0.002), STEPS.index(0.00025), len(STEPS) - 1

LIMIT_RATIO = 0.2
"""Most that the second-order method's error at 2 ms may be, beside that of the default at 0.25 ms."""

LIMIT_REST = 2e-5
"""Largest error (Hz, pu) of the second-order method at 0.125 ms: its limit is the reference."""

CASES = {
    f"{case}-{method}": f"case {case}, {words}, {method}"
    for case, words in (("I", "constant set-points"), ("IV", "closed loop"))
    for method in LEAST_ORDER
}


def _run(name: str, end: float = END) -> CaseResult:
    case, _, text = name.partition("-")
    method: Method = "second-order" if text == "second-order" else "first-order"
    errors = step_errors(case, method, end)
    coarse, fine = ORDER_AT[method]
    order = np.log(errors.always[coarse] / errors.always[fine]) / np.log(STEPS[coarse] / STEPS[fine])
    checks = [ToleranceCheck("order", float(order.min()), LEAST_ORDER[method], at_least=True)]
    if method == "second-order":
        default = step_errors(case, "first-order", end).always[AT_QUARTER]
        ratio = float((errors.always[AT_2_MS] / default).max())
        checks.append(ToleranceCheck("error at 2 ms, of the default's at 0.25 ms", ratio, LIMIT_RATIO))
        checks.append(ToleranceCheck("error at 0.125 ms, Hz or pu", float(errors.always[SMALLEST].max()), LIMIT_REST))
    facts = {
        f"{which} at {STEPS[k] * 1e3:g} ms: f (Hz), P, Q, V (pu)": ", ".join(map(rounded_up, row[k]))
        for which, row in (("error", errors.always), ("after 20 ms,", errors.afterwards))
        for k in (AT_2_MS, AT_QUARTER)
    }
    return CaseResult(name, tuple(checks), facts)


CONVERGENCE = ValidationPart("convergence", ("scipy",), CASES, _run, run_short=lambda name: _run(name, SHORT))
