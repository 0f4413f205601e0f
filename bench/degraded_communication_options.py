"""The tables of docs/handling.md: what each option of `[handling]` costs without faults, and what it gains with them.

.venv/bin/python bench/degraded_communication_options.py              # all, some 4 minutes on two cores
.venv/bin/python bench/degraded_communication_options.py saturation   # or one part: sound, graphs, faults, cut,
saturation
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import gridpeers as gp
from gridpeers.measures import MQSI

SHARED = 0.1
"""Band of MQSI (1) for the time until vars are shared."""

PATH = [[f"inv{i}", f"inv{i + 1}"] for i in range(1, 9)]
GRAPHS: dict[str, dict[str, Any]] = {
    "full": {"graph": "full"},
    "reduced": {"graph": "clustered"},
    "ring": {"graph": "ring"},
    "path": {"graph": "links", "links": PATH},
}
PAPER: dict[str, Any] = {}
NORMALISED = {"weights": "degree-normalised"}
AGEING = {"stale": "age-weighted"}
WAYS: dict[str, dict[str, Any]] = {
    "paper": PAPER,
    "skip": {"stale": "skip"},
    "age-weighted": AGEING,
    "degree-normalised": NORMALISED,
    "both": NORMALISED | AGEING,
}
SOUND = {
    **{way: WAYS[way] for way in ("paper", "skip", "age-weighted", "degree-normalised")},
    "max_age": {"max_age_s": 0.25},
    "no limits": {"anti_windup": "none"},
    "conditional": {"anti_windup": "conditional"},
    "normalised, kappa_c 24": {**NORMALISED, "kappa_c": 24.0},
    "normalised, beta_c 4": {**NORMALISED, "beta_c": 4.0},
}
CONDITIONS = {
    "0.1 s late": ("full", "reduced", "path"),
    "0.5 s late": ("full",),
    "90 % lost": ("full", "reduced", "path"),
}
FAULTS = {"0.1 s late": {"delay": 0.1}, "0.5 s late": {"delay": 0.5}, "90 % lost": {"loss": 0.9}}


@gp.metric("t_Q_s")
def t_Q(window: gp.WindowData) -> float:
    """Return the time (s) from the event until MQSI < 0.1 for good; not a number for never."""
    outside = np.flatnonzero(~(MQSI(window, window.nameplates) < SHARED))
    last = int(outside[-1]) + 1 if outside.size else 0
    return float(window.t[last] - window.start) if last < len(window.t) else np.nan


METRICS = ["t_f_s", "t_share_s", t_Q, "f_error_Hz", "MPSI", "MQSI"]

RunColumns = Mapping[Any, Any]


def swept(cases: Mapping[str, Mapping[str, Any]], end_s: float = 7.0, **plant: float) -> dict[str, RunColumns]:
    """Run islanding with these cases, and these keys of `[plant.gfl]`; a row for each case, by its title."""
    old = dict.fromkeys([f"case.{name}" for name in gp.load("islanding").cases])
    new = {f"case.c{i}": {"secondary": "all", **case, "title": title} for i, (title, case) in enumerate(cases.items())}
    gfl = {f"plant.gfl.{key}": value for key, value in plant.items()}
    scenario = gp.load("islanding").replace({"paper": None, **old, **new, **gfl})
    rows = gp.sweep(scenario, {"time.end_s": [end_s]}, metrics=METRICS).to_dict("records")
    return {scenario.cases[row["case"]].title: row for row in rows}


def shown(row: RunColumns, event: str, names: tuple[str, ...]) -> str:
    """Return the values of one event of a run."""
    values = [row[f"{event}.{name}"] for name in names]
    return " / ".join("never" if np.isnan(x) else f"{x:.3f}" for x in values)


def sound() -> None:
    """Every way on the full graph without faults."""
    rows = swept({name: {**GRAPHS["full"], "handling": way} for name, way in SOUND.items()})
    print("t_f / t_P / t_Q / MQSI after event 1 | event 2")
    for name, row in rows.items():
        print(f"{name:24}", " | ".join(shown(row, e, ("t_f_s", "t_share_s", "t_Q_s", "MQSI")) for e in EVENTS))


def graphs() -> None:
    """Two ways on four graphs without faults."""
    ways = {name: WAYS[name] for name in ("paper", "degree-normalised")}
    cases = {f"{way}, {g}": {**graph, "handling": it} for way, it in ways.items() for g, graph in GRAPHS.items()}
    print("event 2, t_f / t_P / MQSI")
    for name, row in swept(cases, end_s=25.0).items():
        print(f"{name:24}", shown(row, "event2", ("t_f_s", "t_share_s", "MQSI")))


def faults() -> None:
    """Every way over late and lossy links."""
    cases = {
        f"{way}, {graph}, {condition}": {
            **GRAPHS[graph],
            "handling": it,
            "link": [{"on": "* <-> *", **FAULTS[condition]}],
        }
        for condition, on in CONDITIONS.items()
        for graph in on
        for way, it in WAYS.items()
    }
    print("event 2, t_f / t_P / MQSI")
    for name, row in swept(cases, end_s=25.0).items():
        print(f"{name:40}", shown(row, "event2", ("t_f_s", "t_share_s", "MQSI")))


def cut() -> None:
    """One link cut for good before event 2."""
    link = [{"on": "inv4 <-> inv7", "cut": True, "from_s": 3.5}]
    ways = {
        "hold": PAPER,
        "degree-normalised": NORMALISED,
        "skip": WAYS["skip"],
        "age-weighted": AGEING,
        "max_age": SOUND["max_age"],
    }
    cases = {
        f"{way}, {graph}": {**GRAPHS[graph], "handling": it, "link": link}
        for way, it in ways.items()
        for graph in ("full", "reduced")
    }
    print("event 2, f error (Hz) / MPSI")
    for name, row in swept(cases).items():
        print(f"{name:24}", shown(row, "event2", ("f_error_Hz", "MPSI")))


def saturation() -> None:
    """Every anti-windup with the GFM short of power, and with the GFL short of vars."""
    leaders = {"II": {"secondary": "GFM", "graph": "none"}, "III": {"secondary": "GFM", "graph": "GFM-only"}}
    ways = ("clamp", "none", "conditional")
    cases = {f"{name}, {way}": {**it, "handling": {"anti_windup": way}} for name, it in leaders.items() for way in ways}
    print("f error (Hz) after event 1, t_f of event 2 (s)")
    for name, row in swept(cases).items():
        print(f"{name:24}", shown(row, "event1", ("f_error_Hz",)), "|", shown(row, "event2", ("t_f_s",)))
    cases = {f"IV, {way}": {**GRAPHS["full"], "handling": {"anti_windup": way}} for way in ways}
    print("GFL with S_max 0.9 pu: t_Q / MQSI of event 2")
    for name, row in swept(cases, S_max_pu=0.9).items():
        print(f"{name:24}", shown(row, "event2", ("t_Q_s", "MQSI")))


EVENTS = ("event1", "event2")
PARTS: dict[str, Callable[[], None]] = {
    "sound": sound,
    "graphs": graphs,
    "faults": faults,
    "cut": cut,
    "saturation": saturation,
}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()
