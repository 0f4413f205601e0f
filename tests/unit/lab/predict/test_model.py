"""The linear model of law and plant, against the law itself run the plain way."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from gridpeers.agents.agent_config import Gains
from gridpeers.lab.predict.inverter_group import InverterGroup
from gridpeers.lab.predict.linear_model import Loop, Ticks, delay_limit, first_crossing
from gridpeers.scenarios.results.history import Floats
from tests.unit.agents.law_steps import P_set_step
from tests.unit.lab.predict.predicted_graphs import GRAPHS, inverters

UNBOUNDED = Gains(P_set_min=-1e9, P_set_max=1e9)
START, LOAD = 0.00647, 0.0088


def plainly(
    case: InverterGroup, ticks: Ticks, count: int, rng: np.random.Generator | None = None
) -> tuple[Floats, Floats]:
    """Errors e and set-points y under the paper's law and a quasi-steady plant, all remembered: nobody ships it."""
    n, w = case.n, case.weight
    y, e = [np.full(n, START)], [0.0]
    heard = np.full((n, n), START)
    for k in range(1, count + 1):
        e.append(float(w @ y[-1] - LOAD))
        new = np.empty(n)
        for i, dst in enumerate(case.names):
            for j, src in enumerate(case.names):
                lost = rng is not None and rng.random() < _of(ticks.loss, (src, dst))
                if not lost:
                    heard[i, j] = y[max(k - 1 - _of(ticks.link, (src, dst)), 0)][j]
            d = case.heard[i].sum()
            y_bar = case.heard[i] @ heard[i] / d
            m, late = case.m_p[i], e[max(k - ticks.measurement, 0)]
            step = P_set_step(
                y[-1][i] / m, y_bar, d, late, leader=bool(case.leads[i]), m_p=m, gains=case.gains, T=case.T_c
            )
            new[i] = m * step
        y.append(new)
    return np.array(e[1:]), np.array(y[1:])


def _of(value: object, key: object) -> int:
    return value.get(key, 0) if isinstance(value, dict) else value  # type: ignore[return-value]


def drawn(seed: int) -> tuple[InverterGroup, Ticks]:
    """A inverters on some graph with unequal ratings and droops, and a delay of its own for every link."""
    rng = np.random.default_rng(seed)
    case = inverters(list(GRAPHS)[seed % len(GRAPHS)])
    gains = Gains(k_p=case.gains.k_p, P_set_min=-1e9, P_set_max=1e9)
    case = dataclasses.replace(case, gains=gains, m_p=rng.uniform(0.005, 0.02, 9), s=rng.uniform(1.0, 3.0, 9))
    ticks = Ticks(link={(a, b): int(rng.integers(0, 6)) for a in case.names for b in case.names}, measurement=seed)
    return case, ticks


@pytest.mark.parametrize("seed", range(3))
def test_the_linear_model_equals_the_law(seed: int) -> None:
    """The linear map gives the law's own numbers with any delays of links and measurements."""
    case, ticks = drawn(seed)
    e, y = plainly(case, ticks, 60)

    path = Loop(inverters=case, ticks=ticks, plant="quasi-steady").run(60, np.full(9, START), LOAD)

    assert path.e == pytest.approx(e, abs=1e-12)
    assert path.set_point == pytest.approx(y, abs=1e-12)


def test_lossy_links_follow_the_mean() -> None:
    """The mean of 100 runs with a third of all messages lost is the model's at every tick, to 5 standard errors."""
    case = dataclasses.replace(inverters("reduced"), gains=Gains(P_set_min=-1e9, P_set_max=1e9))
    ticks, rng = Ticks(loss=1.0 / 3.0, link=1), np.random.default_rng(1)
    runs = np.array([plainly(case, ticks, 25, rng)[1] for _ in range(100)])

    mean = Loop(inverters=case, ticks=ticks, plant="quasi-steady").run(25, np.full(9, START), LOAD).set_point

    error = runs.std(axis=0) / np.sqrt(len(runs))
    assert (np.abs(runs.mean(axis=0) - mean) <= 5.0 * error + 1e-12).all()


def _swing(case: InverterGroup, ticks: Ticks, plant: str) -> float:
    """By what factor the swing of the set-points grows in 72 s, from 4 s on, when the transient has passed."""
    path = Loop(inverters=case, ticks=ticks, plant=plant).run(4000, np.full(9, START), LOAD)  # type: ignore[arg-type]
    around = np.abs(path.set_point - LOAD).max(axis=1)
    return float(around[-200:].max() / around[200:400].max())


@pytest.mark.parametrize("plant", ["lagged"])
@pytest.mark.parametrize("graph", ["star", "path"])
@pytest.mark.parametrize("kind", ["disagreement", "local loop"])
def test_just_below_the_limit_a_swing_decays_and_just_above_it_grows(graph: str, kind: str, plant: str) -> None:
    """The limits by eigenvalues are those of a simulation in time, to the control period."""
    case = inverters(graph)
    n = round(delay_limit(case, kind, plant=plant) / case.T_c)  # type: ignore[arg-type]
    below, above = (n - 1, n) if kind == "disagreement" else (n, n + 1)

    def ticks(n: int) -> Ticks:
        return Ticks(link=n, own=n) if kind == "disagreement" else Ticks(measurement=n)

    assert _swing(case, ticks(below), plant) < 1.0
    assert _swing(case, ticks(above), plant) > 1.0


@pytest.mark.parametrize("graph", GRAPHS)
def test_late_neighbours_destabilise_a_star_around_a_leader_alone(graph: str) -> None:
    """With fresh own values all graphs but one are stable at any delay; eigenvalues at some delays agree."""
    case = inverters(graph)
    radii = [Loop(inverters=case, ticks=Ticks(link=n)).spectral_radius for n in (0, 8, 26)]

    assert math.isinf(first_crossing(case)) == (graph != "star")
    assert (max(radii) < 1.0) == (graph != "star")


def test_constant_differences_between_parts_of_the_graph_are_counted() -> None:
    """Each further part of the graph keeps one difference for ever, which is no instability."""
    apart = dataclasses.replace(inverters("full"), A=np.kron(np.eye(3), 1.0 - np.eye(3)))

    assert Loop(inverters=apart).resting == 2
    assert Loop(inverters=apart).stable
    assert Loop(inverters=inverters("path")).resting == 0


@pytest.mark.parametrize(("ticks", "said"), [
    (Ticks(link=-1), "0 or more, got -1"),
    (Ticks(loss=30.0), "got 30; write 0.3 for 30 %"),
    (Ticks(loss=1.0), "from 0 to below 1, got 1"),
])  # fmt: skip
def test_impossible_delays_and_losses_are_refused(ticks: Ticks, said: str) -> None:
    """They are errors."""
    with pytest.raises(ValueError, match=said):
        _ = Loop(inverters=inverters("path"), ticks=ticks).matrix
