"""r-robustness of graphs: exact against the definition, bounds that hold, and the numbers of known graphs."""

from __future__ import annotations

from itertools import product
from math import ceil

import numpy as np
import pytest

import gridpeers as gp
from gridpeers.lab.predict.closed_form import robustness, robustness_notes
from tests.unit.lab.predict.predicted_graphs import inverters


def by_definition(A: np.ndarray) -> int:
    """The largest r such that of any two disjoint sets one is r-reachable: every agent is in one, the other or none."""
    n, most = len(A), len(A)
    for where in product((0, 1, 2), repeat=n):
        sets = [[i for i in range(n) if where[i] == k] for k in (1, 2)]
        if all(sets):
            most = min(most, max(sum(A[i, j] > 0 for j in range(n) if where[j] != where[i]) for S in sets for i in S))
    return most


def random_graph(seed: int, n: int, *, directed: bool = False) -> np.ndarray:
    """A random graph without loops."""
    rng = np.random.default_rng(seed)
    A = (rng.random((n, n)) < rng.uniform(0.2, 0.95)).astype(float)
    np.fill_diagonal(A, 0.0)
    return A if directed else np.triu(A) + np.triu(A).T


@pytest.mark.parametrize("seed", range(6))
def test_it_is_what_its_definition_says(seed: int) -> None:
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
    """Return what is said of islanding IV with another law and graph."""
    scenario = gp.load("islanding").replace({"case.IV.law": law, "case.IV.graph": graph, "paper": ""})
    return list(robustness_notes(scenario.spec, scenario.feeder))


def test_a_graph_that_does_not_bear_F_is_named() -> None:
    """Nine agents: a full graph (r 5) bears F = 2, a ring (r 1 or 2) none; without F nothing is said."""
    (said,) = notes({"use": "resilient", "F": 3}, "full")
    assert said.startswith(
        "case IV: W-MSR with F = 3 asks for a graph with r 7, and this one has r 5: even without liars"
    )
    assert said.endswith("take more links, or F = 2 (docs/hostile.md)")
    assert notes({"use": "resilient", "F": 2}, "full") == []
    assert len(notes({"use": "resilient"}, "ring")) == 1  # F is 1 unless said
    assert notes({"use": "resilient", "F": 0, "tolerance": 0.1}, "ring") == []
    assert notes({"use": "consensus"}, "ring") == []
