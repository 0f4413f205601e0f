"""Part "convergence": how the error of a run falls with its step, in both methods, beside the integrated equations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.reference_dynamics import reference_plant
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart, rounded_up
from plant.dynamics.reduction.blas import one_thread
from plant.feeder import Plant
from plant.network import Network
from plant.plant_config import Method, PlantConfig, SwitchEvent
from scenarios.drivers.inprocess import run_inprocess
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs

STEPS = (0.004, 0.002, 0.001, 0.0005, 0.00025, 0.000125)
"""Integration steps h (s); rows are compared every `STEPS[0]`."""

EVENTS = (
    SwitchEvent(t=0.1, switch="13-152", action="open"),
    SwitchEvent(t=0.5, switch="60-160", action="open"),
)
"""Those of the scenario islanding, closer together."""

FIRST = 0.02
"""Time (s) after an event that "afterwards" leaves out."""

QUANTITIES = {"f": "Hz", "P": "pu", "Q": "pu", "V": "pu"}


class StepErrors(NamedTuple):
    """Largest errors over all inverters, steps x quantities of `QUANTITIES`."""

    always: NDArray[np.float64]
    afterwards: NDArray[np.float64]
    """Without the first 20 ms after each event."""


@cache
def step_errors(case: str, method: Method, end: float) -> StepErrors:
    """Return the errors of a method in a case of the scenario islanding, T_c 20 ms, until `end` (s)."""
    t, exact = _reference(case, end)
    late = np.ones(t.size, bool)
    for event in EVENTS:
        late &= (t <= event.t) | (t > event.t + FIRST + 1e-9)
    always, afterwards = [], []
    for h in STEPS:
        error = np.abs(_rows(case, h, end, lambda network, config: _plant(network, config, method))[1] - exact)
        always.append(error.max(axis=(0, 1)))
        afterwards.append(error[late].max(axis=(0, 1)))
    return StepErrors(np.array(always), np.array(afterwards))


@cache
def _reference(case: str, end: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return _rows(
        case, STEPS[0], end, lambda network, config: reference_plant(network, config.settings, config.T_c, STEPS[0])
    )


def _plant(network: Network, config: PlantConfig, method: Method) -> Plant:
    return Plant(network, replace(config.settings, method=method), config.T_c, config.record_step)


@one_thread()
def _rows(
    case: str, h: float, end: float, make: Callable[[Network, PlantConfig], Plant]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (s), and rows x inverters x quantities (Hz, pu) of a run."""
    scenario, feeder = load_scenario("islanding")
    config, agents = configs(scenario, feeder, case)
    settings = replace(config.settings, h=h, events=EVENTS)
    config = replace(config, settings=settings, record_step=STEPS[0], end=end)
    network = Network(feeder)
    rows: list[tuple[float, ...]] = []
    outcome = run_inprocess(config, agents, lambda sent: rows.extend(sent.rows), plant=make(network, config))
    if outcome.broke:
        raise RuntimeError(outcome.broke)
    table = np.array(rows)
    P, V = (np.array([getattr(unit, name) for unit in network.inverters]) for name in ("P_rated", "V_nom"))
    bases = np.column_stack([np.ones(P.size), P, P, V])
    return table[:, 0], table[:, 1:].reshape(len(table), P.size, -1)[:, :, : len(QUANTITIES)] / bases


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
