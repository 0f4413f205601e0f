r"""Theory from the graph alone, in continuous time: rates, settling times, limits of step and delay; robustness.

With y = m_p P_set, K = diag(kappa), the Laplacian L, leaders g and the quasi-steady plant e = w y + const, the paper's
(12), (13) are

.. math:: \dot y = -K (L + g w^T) y + \mathrm{const}

docs/understand/findings.md sums up equations and limits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import Literal, NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from gridpeers.agents.laws.resilient import Resilient
from gridpeers.lab.predict.inverter_group import InverterGroup, inverter_group_of
from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.results.history import Floats
from gridpeers.scenarios.schema.plugin_keys import law_of
from gridpeers.scenarios.schema.scenario_model import ScenarioModel

SETTLING = 4.0  # Time constants after which a mode counts as settled to 2 %, as control texts have it (exactly: 1.8 %)
ZERO = 1e-9  # Rates and eigenvalues below this are zeros with rounding (1/s)

DelayKind = Literal["neighbours", "disagreement", "local loop"]
"""Which values come late: the neighbours' alone; own and neighbours' values alike; measurement or set-point."""


def laplacian(inverters: InverterGroup) -> Floats:
    """Return Laplacian L = diag(A 1) - A (1) among those that run the law; links to others carry constants only."""
    A = inverters.A[np.ix_(inverters.acts, inverters.acts)]
    return np.asarray(np.diag(A.sum(axis=1)) - A)


def groups(inverters: InverterGroup) -> tuple[tuple[str, ...], ...]:
    acting = [name for name, acts in zip(inverters.names, inverters.acts.tolist(), strict=True) if acts]
    count, label = connected_components(inverters.A[np.ix_(inverters.acts, inverters.acts)], directed=False)
    return tuple(tuple(name for name, of in zip(acting, label.tolist(), strict=True) if of == k) for k in range(count))


@dataclass(frozen=True, kw_only=True)
class Modes:
    """Rates of the two slow modes, and times by these rates. Infinite where there is no such mode."""

    links: int
    lambda_2: float
    """Second smallest eigenvalue of L (1), the Fiedler value; 0 when the graph is not connected."""
    lambda_max: float
    kappa: float
    """m_p / k_p (1/s), the mean where droops differ."""
    frequency_rate: float
    """kappa n_L / N (1/s): rate of the frequency if all inverters that run the law shared immediately."""
    sharing_rate: float
    slowest_rate: float
    """Smallest real part of an eigenvalue of K (L + g w^T) (1/s), zeros left out: the exact slower one of the two."""
    fastest_rate: float

    @property
    def euler_step_s(self) -> float:
        """Largest control period (s) with which explicit Euler would be stable, 2 / fastest rate. Our law has none."""
        return math.inf if self.fastest_rate <= 0.0 else 2.0 / self.fastest_rate


def settling(rate: float) -> float:
    return math.inf if rate <= ZERO else SETTLING / rate


def settling_in_ticks(spectral_radius: float, T_c: float) -> float:
    """Return the time (s) in which a mode in discrete time falls to 2 %; infinite when it does not fall."""
    return settling(-math.log(spectral_radius) / T_c) if spectral_radius > 0.0 else 0.0


def modes(inverters: InverterGroup) -> Modes:
    """Return the modes of the secondary law of some inverters, by the continuous equations.

    With unequal droops kappa n_L / N becomes n_L / sum(1/kappa_i), and kappa lambda the eigenvalues of K L: the left
    null vector of K L weighs each set-point with 1/kappa_i. Where some do not run the law, the frequency answers to
    the others by the sum of their w_i only.
    """
    acts = inverters.acts
    if not acts.any():
        raise ValueError(
            "no inverter runs the secondary law, so there are no modes; choose a case with secondary control"
        )
    L, kappa = laplacian(inverters), inverters.kappa[acts]
    lambdas = np.sort(np.linalg.eigvals(L).real)
    sharing = np.sort(np.linalg.eigvals(kappa[:, None] * L).real)
    combined = kappa[:, None] * (L + np.outer(inverters.leads[acts], inverters.weight[acts]))
    rates = np.sort(np.linalg.eigvals(combined).real)
    alone = len(kappa) == 1
    return Modes(
        links=round(float(inverters.A[np.ix_(acts, acts)].sum()) / 2.0),
        lambda_2=math.inf if alone else _zeroed(lambdas[1]),
        lambda_max=_zeroed(lambdas[-1]),
        kappa=float(kappa.mean()),
        frequency_rate=float(inverters.weight[acts].sum() * inverters.leads.sum() / (1.0 / kappa).sum()),
        sharing_rate=math.inf if alone else _zeroed(sharing[1]),
        slowest_rate=float(min((rate for rate in rates if abs(rate) > ZERO), default=0.0)),
        fastest_rate=_zeroed(rates[-1]),
    )


def _zeroed(value: float) -> float:
    return 0.0 if abs(value) < ZERO else float(value)


def delay_limit_closed(inverters: InverterGroup, kind: DelayKind) -> float:
    """Return the longest delay (s) with which the continuous law is stable, the same on every link.

    - "neighbours": infinite on every graph (Atay 2013, without leaders).
    - "disagreement": pi / (2 kappa lambda_max), Olfati-Saber and Murray (2004).
    - "local loop": about pi / (2 slowest rate), as of one integrator with delay; pi N / (2 kappa n_L) when sharing is
      fast.
    """
    found = modes(inverters)
    if kind == "neighbours":
        return math.inf
    if kind == "disagreement":
        rate = float(np.linalg.eigvals(inverters.kappa[inverters.acts][:, None] * laplacian(inverters)).real.max())
    else:
        rate = found.frequency_rate
    return math.inf if rate <= ZERO else math.pi / (2.0 * rate)


def equivalent_delay(T: float, loss: float) -> float:
    """Return how much older (s) a neighbour's value is on average where losses hold the last one: T p / (1 - p)."""
    if not 0.0 <= loss < 1.0:
        raise ValueError(f"loss is a probability from 0 to below 1, got {loss:g}; write 0.3 for 30 %")
    return T * loss / (1.0 - loss)


# -------------------------------------------------------------------- robustness


EXACT = 16  # Most agents for which all pairs of sets are tried: 3^16 pairs, by a recursion over 2^16 sets


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

    A set of agents is r-reachable if one of them hears r agents outside of it. A graph is r-robust if of any two
    disjoint sets, neither empty, one at least is r-reachable (LeBlanc et al., IEEE J. Sel. Areas Commun. 31(4), 2013).
    On a (2F + 1)-robust graph the honest agents agree by W-MSR with F, if each hears at most F liars.

    For more than `exact` agents these are bounds. Above: an agent hears at most its neighbours, and of two sets one has
    at most half of all agents. Below, if all links go both ways: at least lambda_2 |S| |V - S| / |V| links
    leave a set S, so in the smaller of two sets, which is at most half, one agent hears lambda_2 / 2 agents outside.
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


def robustness_notes(scenario: ScenarioModel, feeder: Tables) -> Iterator[str]:
    """Yield a sentence for each case with the law "resilient" whose F is more than its graph certainly tolerates.

    `gridpeers check` prints it. Robustness is a property of the graph, whatever the law.
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
                f"case {case}: W-MSR with F = {F} needs a graph with r {2 * F + 1}, and this one has {found}: even "
                f"without liars its agents may never agree; use more links, or "
                f"F = {found.F} (docs/understand/findings.md)"
            )
