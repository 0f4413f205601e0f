"""The files of a run as pandas tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import nan
from typing import Any

import pandas as pd

from gridpeers.netem.ledger import LinkTrace
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, Violation
from gridpeers.scenarios.results.case_tables import EVENTS, LINKS, event_rows, link_rows
from gridpeers.scenarios.results.metric import unit_of
from gridpeers.scenarios.results.recorded_events import LawFailure
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import suggestion


class HistoryFrame(pd.DataFrame):  # type: ignore[misc]  # pandas has no types here
    """Rows of a run, whose KeyError names the inverters."""

    @property
    def _constructor(self) -> Any:
        return pd.DataFrame

    def __getitem__(self, key: Any) -> Any:
        try:
            return super().__getitem__(key)
        except KeyError:
            names = list(dict.fromkeys(self.columns.get_level_values(0)))
            name = key[0] if isinstance(key, tuple) and key[0] not in names else key
            raise KeyError(f'no inverter "{name}"; {suggestion(str(name), names, "inverters")}') from None


def metrics_frame(windows: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Return the metrics of a case, a row per window; nan where there is no steady value, with the reason in `reasons`.

    >>> frame = metrics_frame({"event1": {"MPSI": None, "V_error": 0.5, "reasons": {"MPSI": "nothing shared"}}})
    >>> bool(frame["MPSI"].isna()["event1"]), frame["reasons"]["event1"]
    (True, 'MPSI: nothing shared')
    """
    rows = {
        label: {name: value for name, value in window.items() if not isinstance(value, dict)}
        for label, window in windows.items()
    }
    frame = pd.DataFrame.from_dict(rows, orient="index").rename_axis("window").apply(pd.to_numeric)
    frame["reasons"] = [
        "; ".join(f"{name}: {text}" for name, text in window.get("reasons", {}).items()) for window in windows.values()
    ]
    frame.attrs["units"] = {name: unit for name in frame if (unit := unit_of(name))}
    return frame


def islands_frame(windows: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Return the metrics of each island, a row per (window, island), of the windows in which there are several.

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


def checks_frame(verdicts: Iterable[CheckVerdict]) -> pd.DataFrame:
    """Return verdicts of checks, a row per check; value, unit and limit are those of its first violation."""
    rows = {}
    for verdict in verdicts:
        first = next(iter(verdict.violations), Violation(text=""))
        of_first = {name: getattr(first, name) for name in ("t", "agent", "value", "unit", "limit")}
        text = {"text": first.text or verdict.reason}
        rows[verdict.check] = {"status": verdict.status, "violations": verdict.count} | of_first | text
    frame = pd.DataFrame.from_dict(rows, orient="index").rename_axis("check")
    frame = frame.astype({name: float for name in ("t", "value", "limit") if rows})
    frame.attrs["units"] = {"t": "s"}
    return frame


def windows_of(case: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the windows among the entries of a case in metrics.json."""
    return {label: value for label, value in case.items() if isinstance(value, dict) and "f_error_Hz" in value}


def failures_frame(failures: Mapping[str, Iterable[LawFailure]]) -> pd.DataFrame:
    """Return the laws that failed, by case, a row each."""
    rows = [(case, *failure) for case, of in failures.items() for failure in of]
    frame = pd.DataFrame(rows, columns=["case", *LawFailure._fields])
    frame.attrs["units"] = {"t": "s"}
    return frame


def events_frame(events: Iterable[PlantEvent]) -> pd.DataFrame:
    """Return the events of a run, a row each; units are in `attrs`."""
    return _table(event_rows(events), EVENTS)


def links_frame(traces: Iterable[LinkTrace]) -> pd.DataFrame:
    """Return the fate of every message on emulated links, link by link; the delay of one that was dropped is nan."""
    frame = _table((row for trace in traces for row in link_rows(trace)), LINKS)
    kinds = {"seq": int, "t": float, "delay": float}
    frame = frame.replace({"delay": {"": nan}}).astype(kinds)
    return frame.sort_values(["src", "dst"], kind="stable", ignore_index=True)


def _table(rows: Iterable[tuple[object, ...]], header: Iterable[str]) -> pd.DataFrame:
    """Return rows with columns as in the header of a file; units go from there into `attrs`."""
    names = [name.removesuffix("_s") for name in header]
    frame = pd.DataFrame(rows, columns=names)
    frame.attrs["units"] = {name.removesuffix("_s"): "s" for name in header if name.endswith("_s")}
    return frame
