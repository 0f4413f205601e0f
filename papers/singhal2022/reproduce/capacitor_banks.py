"""Why our MQSI is not the paper's: the same islanding with one capacitor bank at other buses, and nothing else changed.

The paper prints neither where its capacitors stand nor where its inverters do. Our feeder has 600 kvar in two banks of
300 kvar, at the standard feeder's bus 83 and at bus 151; here they are moved or taken away.
"""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import gridpeers as gp
from gridpeers.output_folders import feeder_folder
from gridpeers.papers.singhal2022.claims.islanding_claims import CASES, EVENTS

if TYPE_CHECKING:
    from gridpeers.papers.singhal2022.figures.var_sharing import EventValues

BANKS: dict[str, dict[str, int]] = {
    "300 kvar at 83, 300 at 151 (ours)": {"83": 100, "151": 100},
    "600 kvar at 83 (as in the standard feeder)": {"83": 200},
    "twice ours: 600 kvar at both": {"83": 200, "151": 200},
    "none of the 600 kvar": {},
}
"""Variants: kvar a phase, by bus."""


def study(
    base: gp.Scenario, folder: Path, tell: Callable[[int, int], None], jobs: int | None, dask: str = ""
) -> dict[str, EventValues]:
    """Run all cases over all variants, and return their MQSI by variant, case and event.

    Parameters
    ----------
    base : Scenario
        The islanding.
    folder : Path
        Takes the variants' feeders.
    tell : Callable[[int, int], None]
        Is called with the number of runs that are done, and of all runs.
    jobs : int or None
        Runs at a time; None is one per core, or one where joblib is not installed.
    dask : str, optional
        Address of a Dask scheduler to use instead.
    """
    standard = feeder_folder(base.spec.plant.feeder)
    feeders = {
        str(_feeder(standard, folder.absolute() / f"feeder{number}", banks)): variant
        for number, (variant, banks) in enumerate(BANKS.items())
    }
    tell(0, len(BANKS) * len(CASES))
    varied = {"plant.feeder": list(feeders)}
    rows = gp.sweep(base.replace({"paper": None}), varied, cases=CASES, jobs=jobs, dask=dask, progress=tell)
    found: dict[str, dict[tuple[str, str], float]] = {variant: {} for variant in BANKS}
    for row in rows.fillna(dict.fromkeys((f"{event}.MQSI" for event in EVENTS), 0.0)).to_dict("records"):
        variant = feeders[row["plant.feeder"]]
        if row["status"] != "ran":
            raise RuntimeError(f"capacitor banks, {variant}, case {row['case']}: {row['why']}")
        found[variant] |= {(row["case"], event): row[f"{event}.MQSI"] for event in EVENTS}
    return dict(found)


def _feeder(standard: Path, folder: Path, banks: Mapping[str, int]) -> Path:
    """Return a copy of a feeder's tables in which the banks of buses 83 and 151 are these."""
    shutil.copytree(standard, folder)
    path = folder / "capacitors.csv"
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    rows = [row for row in rows if row["bus"] not in ("83", "151")]
    for bus, kvar in banks.items():
        rows.append({**rows[0], "bus": bus, "origin": "changed", **{f"Q_{phase}_kvar": kvar for phase in "abc"}})
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return folder
