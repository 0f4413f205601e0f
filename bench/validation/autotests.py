"""Part "autotests": cases of GridLAB-D's own autotests, written anew from their parameters, in both plants.

    python -m bench.validation.autotests GRIDLABD/generators/autotest

compares our run of the secondary-control autotest with the traces that GridLAB-D's source (branch develop) has for it,
made with its default tolerances. Exit code 1 if a power differs by more than the autotest's own tolerance.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.validation import gfm_gfl, secondary_gridlabd
from bench.validation.gfm_gfl import READ, record_gfm_gfl
from bench.validation.secondary_gridlabd import DEVICES, FREQUENCY, POWER, record_secondary
from bench.validation.secondary_plant import SecondaryPlant
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart

LIMIT_S, LIMIT_F, LIMIT_OFFSET = 0.01, 1e-8, 1e-8
"""Largest difference of a power (VA), a frequency (Hz) and a set-point of the controller (pu)."""

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
    steps = round(2.0 / gfm_gfl.H)
    first, second = gfm_gfl.Z_LOAD4[1:]
    theirs = record_gfm_gfl({1: complex(first), 1 + steps: complex(second)}, 1 + 2 * steps).after
    dynamics = gfm_gfl.gfm_gfl_dynamics()
    rows = []
    for z in (first, second):
        dynamics.connect(gfm_gfl.gfm_gfl_circuit(z))
        rows.append(dynamics.run(steps))
    ours = np.concatenate(rows)
    S, f = ours[:, :, 1] + 1j * ours[:, :, 2], ours[:, :, 0]
    S_gap, f_gap = (
        np.abs(own - np.array([theirs[name, key][1:] for name, key, _ in keys]).T)
        for own, keys in ((S, READ[:2]), (f, READ[2:]))
    )
    names = tuple(gfm_gfl.TERMINALS)
    return CaseResult(case, _checks(S_gap, f_gap), _facts(names, S_gap))


def _secondary(case: str) -> CaseResult:
    run = record_secondary(SECONDS[case])
    theirs, ours = run.after, SecondaryPlant(run).run()
    names = secondary_gridlabd.DEVICES
    S_gap = np.abs(ours.S - np.array([theirs[name, POWER[name]][1:] for name in names]).T)
    frequencies = [theirs[name, FREQUENCY[name]][1:] for name in secondary_gridlabd.START_POWER]
    measured_frequency = theirs[f"n{secondary_gridlabd.CONTROL_BUS}", "measured_frequency"][1:]
    f = np.column_stack([ours.f, ours.f_bus])
    f_gap = np.abs(f - np.array([*frequencies, measured_frequency]).T)
    offset_gap = np.abs(
        ours.offset - np.array([theirs[name, "pdispatch_offset"][1:] for name in secondary_gridlabd.SHARES]).T
    )
    controller = ToleranceCheck("set-points of the controller, pu", float(offset_gap.max()), LIMIT_OFFSET)
    return CaseResult(case, (*_checks(S_gap, f_gap), controller), _facts(names, S_gap))


def _checks(S_gap: NDArray[np.float64], f_gap: NDArray[np.float64]) -> tuple[ToleranceCheck, ToleranceCheck]:
    return ToleranceCheck("S, VA", float(S_gap.max()), LIMIT_S), ToleranceCheck("f, Hz", float(f_gap.max()), LIMIT_F)


def _facts(names: Sequence[str], S_gap: NDArray[np.float64]) -> dict[str, str]:
    return {"sources": str(len(names)), "steps": str(len(S_gap))}


AUTOTESTS = ValidationPart("autotests", ("gridlabd",), CASES, _run)


TOLERANCE = 100.0
"""Largest difference in power that the autotest lets pass (VA)."""


def compare_published(folder: Path) -> int:
    """Print the largest difference of each device."""
    ours = SecondaryPlant(record_secondary(SECONDS["secondary"])).run()
    largest = []
    for i, device in enumerate(DEVICES):
        file = folder / f"data_seccntrl_t1{device}PowerAssert.csv"  # one line each ms; the load comes on in the third
        S = np.array([complex(line.partition(",")[2]) for line in file.read_text().splitlines() if line.strip()][2:])
        steps = min(len(S), len(ours.S))
        gap = np.abs(ours.S[:steps, i] - S[:steps])
        largest.append(float(gap.max()))
        print(f"{device}: {largest[-1]:.1f} VA, in step {int(gap.argmax()) + 1} of {steps}")
    return int(max(largest) > TOLERANCE)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit((__doc__ or "").strip())
    sys.exit(compare_published(Path(sys.argv[1])))
