"""The files of a run as pandas tables."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from scenarios.results.link_record import COLUMNS
from scenarios.sweep.column_labels import unit_of


def metrics_frame(windows: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Return the metrics of a case, a row per window; what is no steady value is nan, with its reason in `reasons`.

    Examples
    --------
    >>> frame = metrics_frame({"event1": {"MPSI": None, "V_error": 0.5, "reasons": {"MPSI": "nothing shared"}}})
    >>> bool(frame["MPSI"].isna()["event1"]), frame["reasons"]["event1"]
    (True, 'MPSI: nothing shared')
    """
    rows = {
        label: {name: value for name, value in window.items() if not isinstance(value, dict)}
        for label, window in windows.items()
    }
    frame = pd.DataFrame.from_dict(rows, orient="index").rename_axis("window")
    frame = frame.apply(pd.to_numeric)
    frame["reasons"] = [
        "; ".join(f"{name}: {text}" for name, text in window.get("reasons", {}).items()) for window in windows.values()
    ]
    units = {name: unit_of(name) for name in frame}
    frame.attrs["units"] = {name: unit for name, unit in units.items() if unit}
    return frame


def islands_frame(windows: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Return the metrics of each island, a row per (window, island), of the windows in which there are several.

    Examples
    --------
    >>> islands = {"inv1": {"MPSI": 0.1, "reasons": {}}, "inv4": {"MPSI": 0.2}}
    >>> islands_frame({"event1": {"MPSI": None, "islands": islands}, "event2": {"MPSI": 0.3}})["MPSI"].to_dict()
    {('event1', 'inv1'): 0.1, ('event1', 'inv4'): 0.2}
    """
    frames = {label: metrics_frame(window["islands"]) for label, window in windows.items() if "islands" in window}
    if not frames:
        return pd.DataFrame(index=pd.MultiIndex.from_arrays([[], []], names=["window", "island"]))
    frame = pd.concat(frames, names=["window", "island"])
    frame.attrs["units"] = next(iter(frames.values())).attrs["units"]
    return frame


def windows_of(case: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the windows among what metrics.json holds of a case."""
    return {label: value for label, value in case.items() if isinstance(value, dict) and "f_error_Hz" in value}


def events_frame(file: Path) -> pd.DataFrame:
    """Return what happened, from events.csv."""
    return _from_csv(file, {"t_s": float})


def links_frame(file: Path) -> pd.DataFrame:
    """Return the fate of every message on emulated links, from links.csv; without the file there are no rows."""
    return _from_csv(file, {"seq": int, "t_s": float, "delay_s": _float_or_nan}, COLUMNS)


def _from_csv(
    file: Path, kinds: Mapping[str, Callable[[str], Any]], without: Sequence[str] | None = None
) -> pd.DataFrame:
    """Return the rows of a file, to the last bit of its numbers; units go from its header into `attrs`.

    Parameters
    ----------
    file : Path
        The file.
    kinds : Mapping
        How the columns that are no texts are read.
    without : Sequence[str], optional
        Header of the empty table if there is no such file.
    """
    if without is not None and not file.exists():
        header, rows = list(without), []
    else:
        with file.open(encoding="utf-8", newline="") as opened:
            header, *rows = csv.reader(opened)
    columns = dict(zip(header, zip(*rows, strict=True) if rows else ([] for _ in header), strict=True))
    units = {name: "s" for name in header if name.endswith("_s")}
    frame = pd.DataFrame(
        {name.removesuffix("_s"): [kinds.get(name, str)(text) for text in column] for name, column in columns.items()}
    )
    frame.attrs["units"] = {name.removesuffix("_s"): unit for name, unit in units.items()}
    return frame


def _float_or_nan(text: str) -> float:
    return float(text) if text else float("nan")
