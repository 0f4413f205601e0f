"""Random connected graphs: what every one of them is, and by which law they come."""

from __future__ import annotations

import random
from collections import Counter
from itertools import combinations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from gridpeers.scenarios.sweep.axes import Edges, algebraic_connectivity, connected_graph, connected_graphs


@settings(max_examples=100)
@given(n=st.integers(2, 12), part=st.floats(0.0, 1.0), seed=st.integers(0, 10**6))
def test_a_drawn_graph_is_connected_and_has_its_links(n: int, part: float, seed: int) -> None:
    """From a tree to all pairs: so many different links, all nodes within reach of each other (lambda_2 > 0)."""
    links = n - 1 + int(part * (n * (n - 1) // 2 - n + 1))

    edges = connected_graph(n, links, random.Random(seed))

    assert len(set(edges)) == links
    assert all(0 <= i < j < n for i, j in edges)
    assert algebraic_connectivity(n, edges) > 1e-6


def _trees(n: int, edges: Edges) -> int:
    """Spanning trees of a graph by trying all sets of n - 1 links: the form that everybody can check."""
    return sum(algebraic_connectivity(n, some) > 1e-6 for some in combinations(edges, n - 1))


def test_a_graphs_probability_is_proportional_to_the_number_of_its_spanning_trees() -> None:
    """The law that the module tells: all 15 connected graphs of 4 nodes and 4 links, by chi-square."""
    pairs = tuple(combinations(range(4), 2))
    graphs = [edges for edges in combinations(pairs, 4) if algebraic_connectivity(4, edges) > 1e-6]
    weights = np.array([_trees(4, edges) for edges in graphs], dtype=float)
    rng = random.Random(20)

    counts = Counter(connected_graph(4, 4, rng) for _ in range(4000))

    assert len(graphs) == 15
    assert set(weights) == {3.0, 4.0}
    observed = [counts[edges] for edges in graphs]
    assert chisquare(observed, 4000 * weights / weights.sum()).pvalue > 0.01
    assert chisquare(observed).pvalue < 0.01  # and not uniform, so that the test can tell


def test_graphs_of_a_count_differ_and_stay_when_more_are_asked_for() -> None:
    """No graph is run twice; asking for more, or for other counts, redraws none; with all links there is one."""
    few, many = connected_graphs(9, 34, 5, seed=3), connected_graphs(9, 34, 20, seed=3)

    assert len(set(many)) == 20
    assert many[:5] == few
    assert connected_graphs(9, 34, 5, seed=4) != few
    assert [len(connected_graphs(3, links, 10, seed=1)) for links in (2, 3)] == [3, 1]
