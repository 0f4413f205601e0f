r"""How many liars a graph bears: its r-robustness, exact for a few agents, bounds for many.

A set of agents is r-reachable if one of them hears r agents outside of it. A graph is r-robust if of any two disjoint
sets, neither empty, one at least is r-reachable (LeBlanc et al., IEEE J. Sel. Areas Commun. 31(4), 2013). On a
(2F + 1)-robust graph the honest agents agree by W-MSR with F, if each hears at most F liars.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import NamedTuple

import numpy as np

from gridpeers.agents.laws.resilient import Resilient
from gridpeers.lab.predict.inverter_group import inverter_group_of
from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.results.history import Floats
from gridpeers.scenarios.schema.plugin_keys import law_of
from gridpeers.scenarios.schema.scenario_model import ScenarioModel

EXACT = 16
"""Most agents for which all pairs of sets are tried: 3^16 pairs, by a recursion over 2^16 sets."""


class Robustness(NamedTuple):
    least: int
    most: int

    @property
    def F(self) -> int:
        return max(0, (self.least - 1) // 2)

    def __str__(self) -> str:
        return f"r {self.least}" if self.least == self.most else f"r {self.least}..{self.most}"


def robustness(A: Floats, exact: int = EXACT) -> Robustness:
    """Return the largest r for which a graph is r-robust, by its adjacency (1), row = receiver.

    For more than `exact` agents these are bounds. Above: nobody hears more agents than it has neighbours, and of two
    sets one has at most half of all agents. Below, if all links go both ways: at least lambda_2 |S| |V - S| / |V| links
    leave a set S, so in the smaller one of two sets, which is at most half, someone hears lambda_2 / 2 agents outside.
    """
    links = np.asarray(A) > 0.0
    np.fill_diagonal(links, val=False)
    n = len(links)
    if n < 2:
        return Robustness(n, n)
    if n <= exact:
        r = _exact(links)
        return Robustness(r, r)
    most = min(max(int(links.sum(axis=1).min()), 1), ceil(n / 2))
    if (links != links.T).any():
        return Robustness(0, most)
    L = np.diag(links.sum(axis=1)) - links.astype(float)
    least = ceil(float(np.linalg.eigvalsh(L)[1]) / 2.0 - 1e-9)  # less what may be rounding
    return Robustness(min(max(least, 0), most), most)


def _exact(links: np.ndarray[tuple[int, int], np.dtype[np.bool_]]) -> int:
    """Return min over disjoint sets S, R of max(reach of S, reach of R); the reach is what a member hears outside."""
    n = len(links)
    sets = np.arange(1 << n)
    reach = np.full(1 << n, -1)
    reach[0] = n
    for i in range(n):
        hears = sum(1 << int(j) for j in np.flatnonzero(links[i]))
        outside = np.bitwise_count(hears & ~sets)
        member = (sets >> i & 1).astype(bool)
        reach[member] = np.maximum(reach[member], outside[member])
    least = reach.copy()  # of all sets within a set
    for i in range(n):
        with_i = sets[(sets >> i & 1).astype(bool)]
        least[with_i] = np.minimum(least[with_i], least[with_i ^ (1 << i)])
    whole = (1 << n) - 1
    proper = sets[1:whole]
    return int(np.maximum(reach[proper], least[whole ^ proper]).min())


def robustness_notes(scenario: ScenarioModel, feeder: Feeder) -> Iterator[str]:
    """Yield a sentence for each case with the law "resilient" whose F is more than its graph bears for certain.

    It is for `gridpeers check`: robustness is of the graph, the rest of a prediction of the paper's law alone.
    """
    for case in scenario.cases:
        law = law_of(scenario, case)
        F = int(law.parameters.get("F", Resilient.F)) if law.use == "resilient" else 0
        if not F:
            continue
        inverters = inverter_group_of(scenario, feeder, case)
        found = robustness(inverters.A[np.ix_(inverters.acts, inverters.acts)])
        if found.F < F:
            yield (
                f"case {case}: W-MSR with F = {F} asks for a graph with r {2 * F + 1}, and this one has {found}: even "
                f"without liars its agents may never agree; take more links, or F = {found.F} (docs/hostile.md)"
            )
