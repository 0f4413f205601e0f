"""What follows from the graph alone, against the numbers of the issue's theory: kappa 12 1/s, the paper's graphs."""

from __future__ import annotations

import dataclasses
import math
from itertools import product
from math import ceil

import numpy as np
import pytest

import gridpeers as gp
from gridpeers.lab.predict.closed_form import (
    delay_limit_closed,
    equivalent_delay,
    modes,
    robustness,
    robustness_notes,
    settling,
)
from tests.unit.lab.predict.predicted_graphs import GRAPHS, inverters

TABLE = {
    "full": (36, 9.0, 9.0, 0.04, 1.01, 14.5, 18.2),
    "full less 4-7": (35, 7.0, 9.0, 0.05, 1.01, 14.5, 18.2),
    "reduced": (12, 0.551, 5.449, 0.61, 1.05, 24.0, 30.6),
    "reduced less 4-7": (11, 0.268, 5.449, 1.24, 1.24, 24.0, 30.6),
    "ring": (9, 0.468, 3.879, 0.71, 1.05, 33.7, 43.0),
    "star": (8, 1.0, 9.0, 0.33, 1.14, 14.5, 18.4),
    "path": (8, 0.121, 3.879, 2.76, 2.85, 33.7, 43.0),
}
"""Links, lambda_2, lambda_max, sharing 2 % (s), frequency 2 % (s), limit of kind 2 (ms), Euler's step (ms).

The theory's table has 14.6 ms for the star's limit; pi / (2 kappa 9) is 14.54 ms."""


@pytest.mark.parametrize("graph", TABLE)
def test_eigenvalues_settling_times_and_limits_are_those_of_the_theory(graph: str) -> None:
    """Every number of the theory's table follows from graph, ratings and kappa, to its last printed digit."""
    links, lambda_2, lambda_max, sharing, frequency, kind_2, euler = TABLE[graph]
    found = modes(inverters(graph, kappa=12.0))

    assert found.links == links
    assert found.lambda_2 == pytest.approx(lambda_2, abs=5e-4)
    assert found.lambda_max == pytest.approx(lambda_max, abs=5e-4)
    assert settling(found.sharing_rate) == pytest.approx(sharing, abs=6e-3)
    assert settling(found.slowest_rate) == pytest.approx(frequency, abs=6e-3)
    assert 1e3 * delay_limit_closed(inverters(graph, kappa=12.0), "disagreement") == pytest.approx(kind_2, abs=0.05)
    assert 1e3 * found.euler_step_s == pytest.approx(euler, abs=0.05)


@pytest.mark.parametrize(("kappa", "limit"), [(12.0, 0.39), (40.0, 0.12)])
def test_the_local_loop_has_the_theorys_limit(kappa: float, limit: float) -> None:
    """Pi N / (2 kappa n_L) for three leaders of nine: 0.39 s and 0.12 s."""
    assert delay_limit_closed(inverters("full", kappa=kappa), "local loop") == pytest.approx(limit, abs=5e-3)


def test_lost_messages_are_as_old_as_the_theory_says() -> None:
    """At 20 ms, p = 0.5, 0.7, 0.9 add 20, 47 and 180 ms, to the 20 ms that the theory's 40, 67, 200 ms start from."""
    assert [round(1e3 * equivalent_delay(0.02, p)) for p in (0.5, 0.7, 0.9)] == [20, 47, 180]
    with pytest.raises(ValueError, match=r"got 30; write 0\.3 for 30 %"):
        equivalent_delay(0.02, 30)


def test_where_only_the_leaders_act_the_frequency_answers_by_their_weight() -> None:
    """Without the followers the frequency mode is kappa times the leaders' part of the ratings: 1800 of 3900 kW."""
    whole = inverters("full")
    leaders = dataclasses.replace(whole, acts=whole.GFM)

    assert modes(leaders).frequency_rate == pytest.approx(whole.kappa[0] * 1800.0 / 3900.0)
    assert modes(leaders).slowest_rate == pytest.approx(modes(leaders).frequency_rate, rel=1e-9)


def test_a_lone_leader_has_no_sharing_mode() -> None:
    """The sharing mode is infinitely fast, and the frequency mode is kappa."""
    alone = inverters("full").part(np.arange(9) == 0)

    assert modes(alone).sharing_rate == math.inf
    assert modes(alone).slowest_rate == pytest.approx(alone.kappa[0])
    assert set(GRAPHS) >= set(TABLE)


# -------------------------------------------------------------------- robustness


def by_definition(A: np.ndarray) -> int:
    """The largest r such that of any two disjoint sets one is r-reachable: every agent is in one, the other or none."""
    n, most = len(A), len(A)
    for where in product((0, 1, 2), repeat=n):
        sets = [[i for i in range(n) if where[i] == k] for k in (1, 2)]
        if all(sets):
            most = min(most, max(sum(A[i, j] > 0 for j in range(n) if where[j] != where[i]) for S in sets for i in S))
    return most


def random_graph(seed: int, n: int, *, directed: bool = False) -> np.ndarray:
    rng = np.random.default_rng(seed)
    A = (rng.random((n, n)) < rng.uniform(0.2, 0.95)).astype(float)
    np.fill_diagonal(A, 0.0)
    return A if directed else np.triu(A) + np.triu(A).T


@pytest.mark.parametrize("seed", range(6))
def test_robustness_equals_its_definition(seed: int) -> None:
    """For directed and undirected graphs of two to six agents, by all pairs of sets."""
    A = random_graph(seed, 2 + seed % 5, directed=seed % 2 == 0)

    assert robustness(A) == (by_definition(A), by_definition(A))


def test_known_graphs() -> None:
    """Full graphs are ceil(n/2)-robust; rings, stars and paths 1-robust; apart 0; the paper's as by the definition."""
    for n in (2, 3, 8, 9, 40):
        full = np.ones((n, n)) - np.eye(n)
        assert robustness(full).most == ceil(n / 2)
    assert robustness(np.ones((40, 40))).least == 20
    assert {name: robustness(inverters(name).A).least for name in ("full", "reduced", "ring", "star", "path")} == {
        "full": 5,
        "reduced": 1,
        "ring": 1,
        "star": 1,
        "path": 1,
    }
    assert robustness(np.zeros((3, 3))).least == 0
    assert robustness(np.ones((9, 9))).F == 2


def notes(law: dict[str, object], graph: str) -> list[str]:
    scenario = gp.load("islanding").replace({"case.IV.law": law, "case.IV.graph": graph, "paper": ""})
    return list(robustness_notes(scenario.spec, scenario.feeder))


def test_a_graph_that_does_not_tolerate_F_gives_a_note() -> None:
    """Of nine agents a full graph (r 5) resists two liars and a ring (r 1) none; without F there is no note."""
    (said,) = notes({"use": "resilient", "F": 3}, "full")
    assert said.startswith("case IV: W-MSR with F = 3 needs a graph with r 7, and this one has r 5: even without liars")
    assert said.endswith("use more links, or F = 2 (docs/understand/findings.md)")
    assert notes({"use": "resilient", "F": 2}, "full") == []
    assert len(notes({"use": "resilient"}, "ring")) == 1  # F is 1 unless said
    assert notes({"use": "resilient", "F": 0, "tolerance": 0.1}, "ring") == []
    assert notes({"use": "consensus"}, "ring") == []
