"""The tables of docs/degraded-communication.md: each option's cost and gain.

.venv/bin/python -m bench.tables.degraded_communication_options              # all, some 4 minutes on two cores
.venv/bin/python -m bench.tables.degraded_communication_options cut   # or parts: sound, graphs, faults, cut, saturation
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import gridpeers as gp
from bench.harness import cells, run_parts
from gridpeers.measures import MQSI

SHARED = 0.1
"""Band of MQSI (1) for the time until vars are shared."""

GRAPHS: dict[str, dict[str, Any]] = {
    "full": {"graph": "full"},
    "reduced": {"graph": "clustered"},
    "ring": {"graph": "ring"},
    "path": {"graph": "links", "links": [[f"inv{i}", f"inv{i + 1}"] for i in range(1, 9)]},
}
WAYS: dict[str, dict[str, Any]] = {
    "paper": {},
    "skip": {"stale": "skip"},
    "age-weighted": {"stale": "age-weighted"},
    "degree-normalised": {"weights": "degree-normalised"},
    "both": {"weights": "degree-normalised", "stale": "age-weighted"},
    "max_age": {"max_age_s": 0.25},
    "no limits": {"anti_windup": "none"},
    "conditional": {"anti_windup": "conditional"},
    "normalised, kappa_c 24": {"weights": "degree-normalised", "kappa_c": 24.0},
    "normalised, beta_c 4": {"weights": "degree-normalised", "beta_c": 4.0},
}
FAULTS = {
    "0.1 s late": ({"delay": 0.1}, ("full", "reduced", "path")),
    "0.5 s late": ({"delay": 0.5}, ("full",)),
    "90 % lost": ({"loss": 0.9}, ("full", "reduced", "path")),
}
"""Fault of all links, and the graphs."""


@gp.metric("t_Q_s")
def t_Q(window: gp.WindowData) -> float:
    """Return the time (s) from the event until MQSI < 0.1 for good; not a number for never."""
    outside = np.flatnonzero(~(MQSI(window, window.nameplates) < SHARED))
    last = int(outside[-1]) + 1 if outside.size else 0
    return float(window.t[last] - window.start) if last < len(window.t) else np.nan


METRICS = ["t_f_s", "t_share_s", t_Q, "f_error_Hz", "MPSI", "MQSI"]


def table(
    heading: str, cases: Mapping[str, Mapping[str, Any]], *columns: tuple[str, ...], end_s: float = 7.0, **gfl: float
) -> None:
    """Run islanding with these cases, and these keys of `[plant.gfl]`; print a row for each case."""
    old = dict.fromkeys([f"case.{name}" for name in gp.load("islanding").cases])
    new = {f"case.c{i}": {"secondary": "all", **case, "title": title} for i, (title, case) in enumerate(cases.items())}
    plant = {f"plant.gfl.{key}": value for key, value in gfl.items()}
    scenario = gp.load("islanding").replace({"paper": None, **old, **new, **plant})
    print(heading)
    for row in gp.sweep(scenario, {"time.end_s": [end_s]}, metrics=METRICS).to_dict("records"):
        print(f"{scenario.cases[row['case']].title:40}", " | ".join(cells(row, *names) for names in columns))


def of(event: str, *names: str) -> tuple[str, ...]:
    """Return columns of one event."""
    return tuple(f"{event}.{name}" for name in names)


def sound() -> None:
    """Every way on the full graph without faults."""
    cases = {name: {**GRAPHS["full"], "degraded_communication": way} for name, way in WAYS.items() if name != "both"}
    names = ("t_f_s", "t_share_s", "t_Q_s", "MQSI")
    table("t_f / t_P / t_Q / MQSI after event 1 | event 2", cases, of("event1", *names), of("event2", *names))


def graphs() -> None:
    """Two ways on four graphs without faults."""
    ways = ("paper", "degree-normalised")
    cases = {
        f"{way}, {name}": {**graph, "degraded_communication": WAYS[way]}
        for way in ways
        for name, graph in GRAPHS.items()
    }
    table("event 2, t_f / t_P / MQSI", cases, of("event2", "t_f_s", "t_share_s", "MQSI"), end_s=25.0)


def faults() -> None:
    """Every way over late and lossy links."""
    cases = {
        f"{way}, {graph}, {fault}": {
            **GRAPHS[graph],
            "degraded_communication": WAYS[way],
            "link": [{"on": "* <-> *", **keys}],
        }
        for fault, (keys, on) in FAULTS.items()
        for graph in on
        for way in ("paper", "skip", "age-weighted", "degree-normalised", "both")
    }
    table("event 2, t_f / t_P / MQSI", cases, of("event2", "t_f_s", "t_share_s", "MQSI"), end_s=25.0)


def cut() -> None:
    """One link cut for good before event 2."""
    link = [{"on": "inv4 <-> inv7", "cut": True, "from_s": 3.5}]
    cases = {
        f"{way}, {graph}": {**GRAPHS[graph], "degraded_communication": WAYS[way], "link": link}
        for way in ("paper", "degree-normalised", "skip", "age-weighted", "max_age")
        for graph in ("full", "reduced")
    }
    table("event 2, f error (Hz) / MPSI", cases, of("event2", "f_error_Hz", "MPSI"))


def saturation() -> None:
    """Every anti-windup with the GFM short of power, and with the GFL short of vars."""
    leaders = {"II": {"secondary": "GFM", "graph": "none"}, "III": {"secondary": "GFM", "graph": "GFM-only"}}
    ways = ("clamp", "none", "conditional")
    cases = {
        f"{name}, {way}": {**it, "degraded_communication": {"anti_windup": way}}
        for name, it in leaders.items()
        for way in ways
    }
    heading = "f error (Hz) after event 1 | t_f of event 2 (s)"
    table(heading, cases, of("event1", "f_error_Hz"), of("event2", "t_f_s"))
    cases = {f"IV, {way}": {**GRAPHS["full"], "degraded_communication": {"anti_windup": way}} for way in ways}
    table("GFL with S_max 0.9 pu: t_Q / MQSI of event 2", cases, of("event2", "t_Q_s", "MQSI"), S_max_pu=0.9)


if __name__ == "__main__":
    run_parts(sound=sound, graphs=graphs, faults=faults, cut=cut, saturation=saturation)
