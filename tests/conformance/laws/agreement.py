"""Agents that only agree: a law without a plant, on any graph, which decides when it sends to neighbours."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gridpeers.agents.laws.law import Law, Neighbour, Own

Floats = NDArray[np.float64]
M_P = 0.01


def agreement(
    make: Callable[[], Law], P_set: Sequence[float], links: NDArray[np.bool_], T: float, steps: int
) -> tuple[Floats, int]:
    """Every agent's m_p P_set (pu) at each step, a row each, and how often one sent to its neighbours."""
    n, told = len(P_set), 0
    laws, y = [make() for _ in P_set], [list(P_set)]
    known = list(P_set)
    for k in range(steps):
        owns = [own(i, y[-1][i], k * T) for i in range(n)]
        if k == 0:
            for law, it in zip(laws, owns, strict=True):
                law.start(it)
        decided = [
            law.step(it, [neighbour(j, known[j]) for j in range(n) if links[i, j]], T)
            for i, (law, it) in enumerate(zip(laws, owns, strict=True))
        ]
        for i, decision in enumerate(decided):
            if decision.send:
                known[i], told = decision.P_set, told + 1
        y.append([decision.P_set for decision in decided])
    return M_P * np.array(y), told


def own(i: int, P_set: float, t: float) -> Own:
    """A follower at nominal frequency and voltage."""
    return Own(f"inv{i}", False, t, P_set, 0.0, 1.0, 0.0, 0.0, P_set, 1.0, M_P, 0.05, 1e5, 277.0, 60.0)


def neighbour(j: int, P_set: float) -> Neighbour:
    """Nameplate and state of a neighbour."""
    return Neighbour(f"inv{j}", False, 0.0, 1.0, P_set, 1.0, 0.0, M_P, 0.05, 1e5)


def ring(n: int) -> NDArray[np.bool_]:
    """Links of a ring."""
    links = np.zeros((n, n), dtype=bool)
    for i in range(n):
        links[i, (i + 1) % n] = links[(i + 1) % n, i] = True
    return links


def laplacian(links: NDArray[np.bool_]) -> Floats:
    """Laplacian of unit weights."""
    return np.diag(links.sum(axis=1).astype(float)) - links.astype(float)
