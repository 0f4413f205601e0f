"""Part (c): GridLAB-D's own autotests, in GridLAB-D and in our plant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bench.validation.autotests import gfm_gfl_case
from bench.validation.autotests.gfm_gfl_gridlabd import READ, record_gfm_gfl
from bench.validation.autotests.secondary import secondary_case
from bench.validation.autotests.secondary.secondary_gridlabd import FREQUENCY, POWER, record_secondary
from bench.validation.autotests.secondary.secondary_plant import SecondaryPlant
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart

LIMIT_S, LIMIT_F, LIMIT_OFFSET = 0.01, 1e-8, 1e-8
"""Largest difference of a power (VA), a frequency (Hz) and a set-point of the controller (pu)."""

TEXT = f"""
Two cases that GridLAB-D tests itself with, written anew from their parameters (`bench/validation/autotests`), in
GridLAB-D and in our plant. Power and frequency of every source are compared after every step: within {LIMIT_S:g} VA and
{LIMIT_F:g} Hz.

- `gfm-gfl` is its `test_inverter_dyn_GFM_GFL`: a grid-forming and a grid-following inverter of 200 kVA each, and two
  changes of load. GridLAB-D's own tolerance is 0.1 W, on one phase.
- `secondary` is its `test_seccntrl_t1IEEE-123_Dynamic`: IEEE 123 as an island of four diesel machines, two grid-forming
  inverters and two grid-following current sources, in steps of 1 ms. A load of 411 kW comes on; a controller
  (`sec_control`) at bus 150 moves two machines and two inverters. GridLAB-D's own tolerance is 100 VA.

The plant has no machines, so GridLAB-D simulates them and the plant replays them: each is its Norton equivalent, whose
injection in each network solution is GridLAB-D's. Everything else is ours: network, loads, inverters, the bus's
frequency measurement, and the controller (`secondary_law.py`), which reads our plant and closes its own loop. The
powers of the machines follow from our voltages.

The lines' impedances are computed from conductors and distances, as in GridLAB-D (`line_constants.py`), so both give
the traces that GridLAB-D publishes with that autotest, made with its default tolerances: ours is within 24 VA of them
at all 5000 steps. Its files are not part of this project; with its source beside it,
`python -m bench.validation.autotests.secondary.published_traces GRIDLABD/generators/autotest` compares.
"""

CASES = {
    "gfm-gfl": "one GFM and one GFL, two changes of load",
    "secondary-start": "island with secondary control, until its third action",
    "secondary": "the same for 5 s, as long as the autotest",
}

SECONDS = {"secondary-start": 0.61, "secondary": 5.0}
"""How long the islands run after the load has come on."""


def _run(case: str) -> CaseResult:
    return _secondary(case) if case in SECONDS else _gfm_gfl(case)


def _gfm_gfl(case: str) -> CaseResult:
    steps = round(2.0 / gfm_gfl_case.H)
    first, second = gfm_gfl_case.Z_LOAD4[1:]
    theirs = record_gfm_gfl({1: complex(first), 1 + steps: complex(second)}, 1 + 2 * steps).after
    dynamics = gfm_gfl_case.gfm_gfl_dynamics()
    rows = []
    for z in (first, second):
        dynamics.connect(gfm_gfl_case.gfm_gfl_circuit(z))
        rows.append(dynamics.run(steps))
    ours = np.concatenate(rows)
    S, f = ours[:, :, 1] + 1j * ours[:, :, 2], ours[:, :, 0]
    S_gap, f_gap = (
        np.abs(own - np.array([theirs[name, key][1:] for name, key, _ in keys]).T)
        for own, keys in ((S, READ[:2]), (f, READ[2:]))
    )
    names = tuple(gfm_gfl_case.TERMINALS)
    return CaseResult(case, _checks(S_gap, f_gap), _facts(names, S_gap), _curves(gfm_gfl_case.H, names, S, S_gap))


def _secondary(case: str) -> CaseResult:
    run = record_secondary(SECONDS[case])
    theirs, ours = run.after, SecondaryPlant(run).run()
    names = secondary_case.DEVICES
    S_gap = np.abs(ours.S - np.array([theirs[name, POWER[name]][1:] for name in names]).T)
    frequencies = [theirs[name, FREQUENCY[name]][1:] for name in secondary_case.START_POWER]
    measured_frequency = theirs[f"n{secondary_case.CONTROL_BUS}", "measured_frequency"][1:]
    f = np.column_stack([ours.f, ours.f_bus])
    f_gap = np.abs(f - np.array([*frequencies, measured_frequency]).T)
    offset_gap = np.abs(
        ours.offset - np.array([theirs[name, "pdispatch_offset"][1:] for name in secondary_case.SHARES]).T
    )
    controller = ToleranceCheck("set-points of the controller, pu", float(offset_gap.max()), LIMIT_OFFSET)
    curves = _curves(secondary_case.H, names, ours.S, S_gap)
    return CaseResult(case, (*_checks(S_gap, f_gap), controller), _facts(names, S_gap), curves)


def _checks(S_gap: NDArray[np.float64], f_gap: NDArray[np.float64]) -> tuple[ToleranceCheck, ToleranceCheck]:
    return ToleranceCheck("S, VA", float(S_gap.max()), LIMIT_S), ToleranceCheck("f, Hz", float(f_gap.max()), LIMIT_F)


def _facts(names: Sequence[str], S_gap: NDArray[np.float64]) -> dict[str, str]:
    return {"sources": str(len(names)), "steps": str(len(S_gap))}


def _curves(
    h: float, names: Sequence[str], S: NDArray[np.complex128], S_gap: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    t = np.arange(1, len(S) + 1) * h
    powers = {name: S[:, i].real / 1e3 for i, name in enumerate(names)}
    return {"t": t, "gap": S_gap.max(axis=1), **powers}


def _draw(results: Sequence[CaseResult]) -> Figure:
    """Draw the powers, and below them the largest difference of any power."""
    shown = [result for result in results if result.case != "secondary-start"]
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    panels = figure.subplots(2, len(shown), sharex="col", squeeze=False, height_ratios=(2, 1))
    for column, result in enumerate(shown):
        top, bottom = panels[:, column]
        _draw_powers(top, result)
        curves = result.curves
        bottom.semilogy(curves["t"], np.maximum(curves["gap"], 1e-9), linewidth=0.8, color="black")
        bottom.axhline(LIMIT_S, color="black", linestyle=":", linewidth=1.0)
        bottom.set_xlabel("time since the first change (s)")
    panels[0, 0].set_ylabel("P (kW)")
    panels[1, 0].set_ylabel("difference of S\n(VA)")
    return figure


def _draw_powers(axes: Axes, result: CaseResult) -> None:
    for name, values in result.curves.items():
        if name not in ("t", "gap"):
            style = "--" if name.startswith("Gen") else "-"
            axes.plot(result.curves["t"], values, style, linewidth=1.0, label=name)
    axes.set_title(result.case)
    axes.legend(fontsize="x-small", ncols=2)


AUTOTESTS = ValidationPart("autotests", "GridLAB-D's autotests", TEXT, ("gridlabd",), CASES, _run, _draw)
