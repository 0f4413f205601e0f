"""The tables of docs/theory.md: what is predicted beside what the agents do on the plant, on eight graphs.

.venv/bin/python -m bench.tables.theory_tables            # all, some 4 minutes on two cores
.venv/bin/python -m bench.tables.theory_tables limits     # or one part: times, late, limits, vars
"""

from __future__ import annotations

from functools import cache
from typing import Any

import gridpeers as gp
from bench.harness import cells, run_parts
from gridpeers.theory import (
    LoadStep,
    ScenarioModel,
    delay_limit,
    feeder_of,
    first_window,
    inverter_group_of,
    load_steps,
    predicted_times,
    var_delay_limit,
    var_growth,
    var_response,
)
from scenarios.predict.closed_form import delay_limit_closed

ALONE = 1e5
"""k_q that leaves V_set alone."""

CUT = {"without": [["inv4", "inv7"]]}


def star(hub: int) -> dict[str, Any]:
    """Return the links of one inverter with each of the others."""
    return {"graph": "links", "links": [[f"inv{hub}", f"inv{i}"] for i in range(1, 10) if i != hub]}


GRAPHS: dict[str, dict[str, Any]] = {
    "full": {"graph": "full"},
    "full less 4-7": {"graph": "full", **CUT},
    "reduced": {"graph": "clustered"},
    "reduced less 4-7": {"graph": "clustered", **CUT},
    "ring": {"graph": "ring"},
    "star, hub inv1": star(1),
    "star, hub inv2": star(2),
    "path": {"graph": "links", "links": [[f"inv{i}", f"inv{i + 1}"] for i in range(1, 9)]},
}
TUNED = "reduced, alpha 1, beta 4"
LATE = ("full", "reduced", "ring", "path")
LIMITS = ("full", "reduced", "ring", "star, hub inv1", "star, hub inv2", "path")
GROWTH = ("full", "reduced", TUNED, "ring", "path", "star, hub inv1")
DELAYS = (0.02, 0.1, 0.16, 0.26, 0.34, 0.42, 0.5, 0.6, 1.0)


@cache
def scenario() -> gp.Scenario:
    """Islanding under every graph, with good links."""
    old = gp.load("graphs")
    gains = {"k_p": 0.0007, "k_q": 0.25, "alpha": 1.0, "beta_GFM": 4.0, "beta_GFL": 4.0}
    cases = {f"case.{name(title)}": {"secondary": "all", "title": title, **graph} for title, graph in GRAPHS.items()}
    tuned = {"secondary": "all", "title": TUNED, **GRAPHS["reduced"], "gains": gains}
    gone = {f"case.{case}": None for case in old.cases}
    return old.replace({**gone, **cases, f"case.{name(TUNED)}": tuned})


def name(title: str) -> str:
    """Return the name of the case of a graph."""
    return "".join(c for c in title if c.isalnum())


@cache
def calm() -> ScenarioModel:
    """Return the scenario with its first event alone."""
    return first_window(scenario().spec, 3.0)


@cache
def load() -> LoadStep:
    """Return the step of load of islanding."""
    (step,) = load_steps(calm(), feeder_of(scenario().spec))
    assert step.load is not None
    return step.load


def inverters(title: str) -> Any:
    """Return the inverters on a graph."""
    return inverter_group_of(scenario().spec, feeder_of(scenario().spec), name(title))


def compare(titles: tuple[str, ...], end_s: float, d: float) -> None:
    """Print times to restore and to share: predicted, measured with V_set left alone, and with the whole law."""
    link = [{"on": "* <-> *", "delay": d}] if d else None
    rows = gp.sweep(
        scenario().replace({"time.end_s": end_s, "link": link}),
        {"gains.k_q": [ALONE, 0.25]},
        cases=[name(title) for title in titles],
        metrics=["t_f_s", "t_share_s"],
    ).to_dict("records")
    print(f"links late by {d:g} s: f / sharing (s), predicted | V_set left alone | whole law")
    for title in titles:
        predicted = predicted_times(inverters(title), link_delay_s=d, load=load())
        texts = [cells({"f": predicted.restore_s, "P": predicted.share_s}, "f", "P")]
        for k_q in (ALONE, 0.25):
            (row,) = (row for row in rows if (row["case"], row["gains.k_q"]) == (name(title), k_q))
            texts.append(cells(row, "event1.t_f_s", "event1.t_share_s"))
        print(f"{title:20}", " | ".join(f"{text:14}" for text in texts))


def times() -> None:
    """How near theory comes with good links."""
    compare(tuple(GRAPHS), 7.0, 0.0)


def late() -> None:
    """The same with late links."""
    for d in (0.12, 0.52):
        compare(LATE, 31.0, d)


def limits() -> None:
    """Longest delays (s), in discrete time (by the continuous law)."""
    response = var_response(calm(), feeder_of(scenario().spec))
    print("links | both alike (continuous) | f or P_set late (continuous) | V, Q or V_set late")
    for title in LIMITS:
        one = inverters(title)
        limits_s = [f"{delay_limit(one, 'neighbours'):.2f}"]
        limits_s += [
            f"{delay_limit(one, kind):.2f} ({delay_limit_closed(one, kind):.3f})"
            for kind in ("disagreement", "local loop")
        ]
        print(f"{title:20}", " | ".join([*limits_s, f"{var_delay_limit(one, response):.2f}"]))


def vars_() -> None:
    """Growth (1/s) of vars over late links."""
    response = var_response(calm(), feeder_of(scenario().spec))
    print("delay (s)  " + "  ".join(GROWTH))
    for d in DELAYS:
        print(
            f"{d:<10}", "  ".join(f"{var_growth(inverters(title), response, link_delay_s=d):.2f}" for title in GROWTH)
        )


if __name__ == "__main__":
    run_parts(times=times, late=late, limits=limits, vars=vars_)
