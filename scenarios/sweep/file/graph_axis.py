"""Random connected graphs with a given number of links.

The distribution: a spanning tree, uniform among all labelled trees (by its Pruefer code), and then links drawn
uniformly among the pairs that are still free. So every connected graph can come; a graph's probability is proportional
to the number of its spanning trees, which prefers evenly meshed graphs to those with a dense core and a long tail.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from itertools import combinations

import numpy as np

Edges = tuple[tuple[int, int], ...]
"""Pairs i < j, sorted."""

TRIES = 200
"""Draws per graph that is asked for, until it is held that there are no more different ones."""


def connected_graphs(n: int, links: int, count: int, seed: int) -> tuple[Edges, ...]:
    """Different connected graphs of n nodes, drawn one after the other, each number with its own stream.

    So the first graphs stay the same when more are asked for. There are fewer than `count` where so many do not exist:
    with all links, one.

    Parameters
    ----------
    n : int
        Nodes, at least 2.
    links : int
        From n - 1 to n (n - 1) / 2.
    count : int
        How many graphs.
    seed : int
        Of the draws.

    Examples
    --------
    >>> [len(graph) for graph in connected_graphs(9, 12, 3, seed=1)], len(connected_graphs(9, 36, 10, seed=1))
    ([12, 12, 12], 1)
    """
    most = 1 if links == n * (n - 1) // 2 else count
    found: dict[Edges, None] = {}
    for i in range(TRIES * count):
        if len(found) >= most:
            break
        found.setdefault(connected_graph(n, links, random.Random(f"{seed}/{n}/{links}/{i}")))
    return tuple(found)


def connected_graph(n: int, links: int, rng: random.Random) -> Edges:
    """Draw one graph by this distribution; only `rng.random()` is used, the same in every version of Python."""
    assert n - 1 <= links <= n * (n - 1) // 2
    tree = _tree([int(rng.random() * n) for _ in range(n - 2)])
    free = [pair for pair in combinations(range(n), 2) if pair not in tree]
    more = [free.pop(int(rng.random() * len(free))) for _ in range(links - len(tree))]
    return tuple(sorted([*tree, *more]))


def algebraic_connectivity(n: int, edges: Sequence[tuple[int, int]]) -> float:
    r"""Second smallest eigenvalue :math:`\lambda_2` of the Laplacian with weight 1 per link (Fiedler, 1973).

    Examples
    --------
    >>> round(algebraic_connectivity(3, [(0, 1), (1, 2)]), 9)
    1.0
    """
    L = np.zeros((n, n))
    for i, j in edges:
        L[[i, j], [i, j]] += 1.0
        L[[i, j], [j, i]] -= 1.0
    return float(f"{np.linalg.eigvalsh(L)[1]:.9g}")  # the last digits are the library's, not the graph's


def _tree(code: Sequence[int]) -> set[tuple[int, int]]:
    """Tree of a Pruefer code: each tree of n labelled nodes has exactly one code of n - 2 numbers below n."""
    n = len(code) + 2
    degree = [1 + code.count(i) for i in range(n)]
    edges = set()
    for node in code:
        leaf = degree.index(1)
        edges.add((min(leaf, node), max(leaf, node)))
        degree[leaf] -= 1
        degree[node] -= 1
    i, j = (node for node in range(n) if degree[node] == 1)
    return edges | {(i, j)}
