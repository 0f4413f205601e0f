"""Compares our run of the secondary-control autotest with the traces that GridLAB-D's source has for it.

    python -m bench.validation.autotests.secondary.published_traces GRIDLABD/generators/autotest

The folder is of GridLAB-D's source, branch develop; the traces were made with its default tolerances. Exit 1 if a power
differs by more than the autotest's own tolerance.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.validation.autotests.secondary.secondary_case import DEVICES
from bench.validation.autotests.secondary.secondary_gridlabd import record_secondary
from bench.validation.autotests.secondary.secondary_plant import SecondaryPlant

TOLERANCE = 100.0
"""Of the autotest (VA)."""

SECONDS = 5.0


def published_power(folder: Path, device: str) -> NDArray[np.complex128]:
    """Return the published powers (VA) of a device from the step on in which the load comes on, one each ms."""
    lines = (folder / f"data_seccntrl_t1{device}PowerAssert.csv").read_text(encoding="utf-8").splitlines()
    return np.array([complex(line.partition(",")[2]) for line in lines if line.strip()][2:])


def main(folder: Path) -> int:
    """Print the largest difference of each device."""
    published = {device: published_power(folder, device) for device in DEVICES}
    ours = SecondaryPlant(record_secondary(SECONDS)).run()
    largest = []
    for i, (device, S) in enumerate(published.items()):
        steps = min(len(S), len(ours.S))
        gap = np.abs(ours.S[:steps, i] - S[:steps])
        largest.append(float(gap.max()))
        print(f"{device}: {largest[-1]:.1f} VA, in step {int(gap.argmax()) + 1} of {steps}")
    return int(max(largest) > TOLERANCE)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit((__doc__ or "").strip())
    sys.exit(main(Path(sys.argv[1])))
