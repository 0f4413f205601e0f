"""Part (e): how the plant's error falls with its step, in both methods of time stepping."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bench.validation.convergence.step_errors import QUANTITIES, STEPS, StepErrors, step_errors
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

TEXT = f"""
The scenario islanding with T_c = 20 ms on the complete 123-node feeder, its events at 0.1 and 0.5 s, at six steps h, in
both methods of time stepping ([plant.md](plant.md#method-of-time-stepping)). The reference is scipy: `solve_ivp`
(DOP853, relative tolerance 1e-7) integrates the inverters' equations, which `bench/validation/convergence` writes again
from [inverter-models.md](inverter-models.md), and Newton's method solves the network to 1e-12 in every evaluation.
Errors are the largest over all inverters and all rows, 4 ms apart, from 0 to {END:g} s; the tests end at {SHORT:g} s.

- Both methods converge to the integrated equations. The default, GridLAB-D's, is of first order: feed-forward acts a
  pass late, a GFM's integrators take the slopes of the pass's end, and P, Q, V are those of the predictor. Its error
  after the first 20 ms is of first order, too. At 4 ms it rings. Feed-forward makes most of it: with GFL as current
  sources, which have none, its error through the islanding is a twelfth (f 0.014 Hz, P 0.014 pu at 2 ms).
- At 2 ms the second-order method is more accurate than the default at 0.25 ms, in every quantity; the table has the
  largest of the four ratios. A step of it takes about 2.5 times a default step, so the same accuracy costs a third.
  With GFL as current sources both are about equal there: f 0.0025 against 0.0013 Hz, P 0.0015 pu both, Q and V half.
- The error of f is that of the PLLs, whose frequency follows the voltage's angle at once.
"""

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
    return CaseResult(name, tuple(checks), facts, _curves(errors))


def _curves(errors: StepErrors) -> dict[str, NDArray[np.float64]]:
    curves = {quantity: errors.always[:, k] for k, quantity in enumerate(QUANTITIES)}
    return curves | {f"{quantity} late": errors.afterwards[:, k] for k, quantity in enumerate(QUANTITIES)}


def _draw(results: Sequence[CaseResult]) -> Figure:
    """Draw each quantity's largest error against h, with the slopes of first and second order."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    h = np.array(STEPS) * 1e3
    panels = figure.subplots(2, 2, sharex=True).ravel()
    for axes, (quantity, unit) in zip(panels, QUANTITIES.items(), strict=True):
        for result in results:
            colour = "C3" if result.case.endswith("first-order") else "C0"
            marker = "o" if result.case.startswith("I-") else "x"
            label = result.case.replace("-", ", ", 1)
            axes.loglog(h, result.curves[quantity], marker=marker, color=colour, linewidth=1.0, label=label)
            axes.loglog(h, result.curves[f"{quantity} late"], linestyle="--", color=colour, linewidth=0.7)
        for order, name in ((1, "first-order"), (2, "second-order")):
            at = next(result for result in results if result.case == f"I-{name}").curves[quantity][2]
            axes.loglog(h, 2.5 * at * h**order, color="grey", linestyle=":", linewidth=1.0)
        axes.set_ylabel(f"error of {quantity} ({unit})")
        axes.set_xticks(h, [f"{each:g}" for each in h])
        axes.minorticks_off()
    for axes in panels[2:]:
        axes.set_xlabel("h (ms)")
    figure.suptitle("Largest error; dashed: after 20 ms; dotted: slopes of h and h squared")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper")
    return figure


CONVERGENCE = ValidationPart(
    "convergence",
    "Convergence in the step, beside scipy",
    TEXT,
    ("scipy",),
    CASES,
    _run,
    _draw,
    run_short=lambda name: _run(name, SHORT),
)
