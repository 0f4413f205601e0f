"""Part (b): the whole plant beside GridLAB-D, at the same step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from cycler import cycler
from matplotlib import rcParams
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bench.validation.gridlabd.both_plants import QUANTITIES, compare
from bench.validation.gridlabd.compared_runs import RUNS, SHORT
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart

PHYSICAL = ("f", "P", "Q", "V")

WINDOW = 25
"""Steps of which the figure draws the largest difference."""

ANGLE_LIMIT = 0.1
"""How far (deg) from its angle a switch may close: a step shifts it by as much."""

_LEFT_OUT = [f"`{name}`" for name, run in RUNS.items() if not run.in_tests]

TEXT = f"""
f, P, Q, V and the held set-points of all inverters on the complete 123-node feeder, in our plant and in
GridLAB-D's delta mode (`inverter_dyn`, its voltage tolerance 1e-11 pu), after every step of 2 ms. GridLAB-D reads a
model that `plant/gridlabd/model/glm.py` writes from the CSV tables without any code of `plant.tables` and
`plant.network`. Each plant starts from its own equilibrium, which it has held for 0.5 s, and in closed loop has agents
of its own. The tests go through all cases but {", ".join(_LEFT_OUT[:-1])} and {_LEFT_OUT[-1]}, in a fifth of the time.
`feeder glm` and `--plant gridlabd` have the same model.

- Closed switches and regulators are ideal in both. GridLAB-D needs an impedance for each (1e-4 - j1e-4 and 1e-4 ohm by
  default), and gets one; a line of its negative follows in series, so together they have none, exactly. With the
  default impedances `islanding-I` differs by 2e-4 Hz and pu. Line charging is on in both.
- A reclosing is rehearsed by our plant: 13-152 closes on the first control period in which its sides are further apart
  than the angle, and its opening is put off by the steps that bring the angle back; the column tells the angle that
  each plant has across the switch in the step before it closes. At 120 degrees both agree in the step of the closing;
  then u_d of some GFL is negative, by which GridLAB-D divides, where we divide by at least 1e-3 pu.
- GridLAB-D has one rating where a GFL has P_set_lim 1 pu and S_max 1.2 pu here. Where no reference exceeds the rating,
  its `rated_power` is S_max ratings, with all per-unit values converted; `set-points` and `wind-up` have S_max = 1 (and
  V_set_max = 2 pu, because GridLAB-D does not bound V_set). There GridLAB-D clips `Pref` in place at 1 pu, in the step
  in which it is written, before the droop; `Pref_max` bounds the reference only after the droop. Without our clip
  (P_set_lim 3 pu) `set-points` differs by 0.18 pu and 0.034 Hz.
- GridLAB-D de-energises microgrid 1 when sw1_2 and sw2_3 open in the same step, so `three-islands` opens them 4 ms
  apart.
- `single-phase-IV` and `single-phase-limits` have five single-phase inverters beside the nine. An inverter of
  GridLAB-D has the phases of its node, so each stands at a child node of its own phase. There GridLAB-D takes one
  inverter a bus, and only a GFM of three phases keeps an island alive.
- With dead bands, and with volt-var off, a start on the droop differs by 0.21 pu of Q in the first row, as ours did
  once: within its band a GFL rests without vars. At the edge of a band the reference jumps (db / m_q), so some GFL have
  no rest: their Q hunts, by 0.05 pu at inv9 at the end of `dead-bands`, in both plants alike. Where a GFL hunts at the
  start already ([plant.md](plant.md#dead-bands)), the plants hunt out of phase: with bands of 0.005 pu they differ by
  0.015 pu of Q and 0.002 Hz.
- It can fail. One character was changed by hand, and put back: the sign of the Q-V droop in `kernel/gfm.py` gives
  0.06 Hz and 1.3 pu of reactive power; that of the overload limiter lets inverters trip in `set-points`; 3 pi in place
  of 2 pi in the P-f droop of `glm_inverters.py` gives 0.2 Hz; a mile of 1.609345 instead of 1.609344 km in
  `glm_network.py` gives 7e-8 Hz and 2e-7 pu; 0.6 in place of 0.5 of the line charging in
  `primitives.py` gives 4e-6 pu in the power flow.
- The phase-current limit of the GFM, 2 pu in both, acts in no case but two. `reclosing-70` does without it.
  `current-limit` has it at 1.8 pu: both plants reduce currents and solve until no current is beyond the limit, but the
  angles that remain depend on the iterations, which differ. With 1.6 pu neither finds a solution.
- Not compared: inverters that join and leave.
"""


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
    curves: dict[str, NDArray[np.float64]] = {"t": compared.t}
    curves |= {quantity: compared.differences[quantity].max(axis=1) for quantity in PHYSICAL}
    return CaseResult(case, tuple(checks), facts, curves)


def _draw(results: Sequence[CaseResult]) -> Figure:
    """Draw the largest difference over all inverters, over time."""
    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True).ravel()
    # More cases than colours: those of the second round are dashed.
    styles = cycler(linestyle=["-", "--"]) * cycler(color=rcParams["axes.prop_cycle"].by_key()["color"])
    for axes, quantity in zip(panels, PHYSICAL, strict=True):
        axes.set_prop_cycle(styles)
        for result in results:
            n = len(result.curves["t"]) // WINDOW * WINDOW
            t, gap = (result.curves[name][-n:].reshape(-1, WINDOW) for name in ("t", quantity))
            axes.semilogy(t.max(axis=1), np.maximum(gap.max(axis=1), 1e-17), label=result.case, linewidth=0.9)
        axes.axhline(1e-8, color="black", linestyle=":", linewidth=1.0)
        axes.set_ylabel(f"{quantity} ({QUANTITIES[quantity]})")
    for axes in panels[2:]:
        axes.set_xlabel("t (s)")
    figure.suptitle("Largest difference over the inverters\ndotted: the limit, but for current-limit (2e-5)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper")
    return figure


GRIDLABD = ValidationPart(
    "gridlabd",
    "Dynamics, beside GridLAB-D",
    TEXT,
    ("gridlabd",),
    {name: run.text for name, run in RUNS.items()},
    _run,
    _draw,
    run_short=lambda case: _run(case, SHORT),
)
