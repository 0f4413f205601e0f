"""What an agent makes of late, lost and missing states, and of a saturated inverter: table `[handling]`. Pure.

The law is `agents.laws.consensus`; here is decided with which weights c_ij, gains and limits it is called. With r_ij,
from 0 to 1, what the state of neighbour j is worth to i (`StalenessWeights`), and d_i the number of neighbours that
count:

- weights "paper": c_ij = r_ij. The gain of the consensus on y = m_p P_set is kappa = m_p/k_p.
- weights "degree-normalised": c_ij = r_ij/d_i. The gain is kappa_c, that of the leader's frequency error stays kappa:
  y_i' = -kappa g_i e_i - kappa_c/d_i sum_j r_ij (y_i - y_j). In (14) and (15) beta becomes beta beta_c.

A neighbour counts while its nameplate is known, it stands in the own island, its state was heard at all, and that state
is no older than `max_age`. So a lossy link keeps its place in d_i, and a dead one loses it.

docs/handling.md has the sources, and what each option costs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from math import exp, inf

from msgspec.structs import replace

from agents.agent_config import Gains, Handling

REMEMBERED = 51
"""Arrivals over which the usual age of a link's states is taken: a second at 20 ms."""

OFF = 0.05
"""Distance (pu of own rating) from which on an inverter is off its droop characteristic; so much may still wind up."""

P_NONSENSE, V_NONSENSE = 100.0, 10.0
"""Limits (pu) of P_set, either way, and of V_set, from 0, where nothing shall be limited but nonsense."""


class StalenessWeights:
    """What the last state heard of each neighbour is worth, from 0 to 1.

    Parameters
    ----------
    handling : Handling
        `stale`, `T_age` and `max_age`.

    Examples
    --------
    A link whose states always are 0.1 s old loses nothing by it; one that falls silent fades:

    >>> worth = StalenessWeights(Handling(stale="age-weighted", T_age=0.25))
    >>> worth.arrived("inv2")
    >>> worth.at_tick({"inv2": 0.5}), worth.at_tick({"inv2": 0.75})
    ({'inv2': 1.0}, {'inv2': 0.36787944117144233})
    """

    def __init__(self, handling: Handling) -> None:
        self._stale, self._T_age = handling.stale, handling.T_age
        self._max_age = handling.max_age or inf
        self._fresh: set[str] = set()
        """Of whom a state has arrived since the last tick."""
        self._usual: dict[str, deque[float]] = {}
        """Ages (s) of each neighbour's last states, each at the first tick that could use it."""

    def arrived(self, name: str) -> None:
        """Note that a newer state of a neighbour is here."""
        self._fresh.add(name)

    def forget(self, name: str) -> None:
        """Forget a neighbour and its link."""
        self._fresh.discard(name)
        self._usual.pop(name, None)

    def at_tick(self, ages: Mapping[str, float]) -> dict[str, float]:
        """Worth of each neighbour that counts, at a tick; what arrives from now on is for the next one.

        Parameters
        ----------
        ages : Mapping[str, float]
            Age (s of run time) of the last state heard of each neighbour.
        """
        worth = {name: self._of(name, age) for name, age in ages.items() if age <= self._max_age}
        self._fresh.clear()
        return worth

    def _of(self, name: str, age: float) -> float:
        if self._stale == "hold":
            return 1.0
        fresh = name in self._fresh
        if self._stale == "skip":
            return float(fresh)
        usual = self._usual.setdefault(name, deque(maxlen=REMEMBERED))
        if fresh or not usual:
            usual.append(age)
        median = sorted(usual)[len(usual) // 2]
        return exp(-max(0.0, age - median) / self._T_age)


class SaturationDetector:
    """Whether an inverter follows its droop characteristic; where it does not for long, its set-point is in vain.

    An inverter that is only slow is off its characteristic too, but on the way to it.

    Parameters
    ----------
    T_sat : float
        How long (s) it must have been off on the same side, and moved by less than half of what is missing.

    Examples
    --------
    >>> P = SaturationDetector(T_sat=0.25)
    >>> [P.saturated_side(should=1.0, does=0.8, t=t) for t in (1.0, 1.125, 1.25)], P.saturated_side(1.0, 1.0, t=1.5)
    ([0, 0, 1], 0)
    """

    def __init__(self, T_sat: float) -> None:
        self._T_sat = T_sat
        self._side = 0
        self._since: deque[tuple[float, float]] = deque()
        """When (s) it did what (pu): since it went to this side, but of what is longer ago than T_sat only the last."""

    def begin(self) -> None:
        """Forget what it did, as its set-points were not the law's meanwhile."""
        self._side = 0
        self._since.clear()

    def saturated_side(self, should: float, does: float, t: float) -> int:
        """1 where the inverter gives less than it should and cannot more, -1 where more and cannot less, else 0.

        Parameters
        ----------
        should : float
            What the set-point asks of it (pu).
        does : float
            What the own measurement says in its place (pu): output plus what the droop takes.
        t : float
            Run time (s).
        """
        short = should - does
        side = (short > OFF) - (short < -OFF)
        if side != self._side:
            self._side = side
            self._since.clear()
        self._since.append((t, does))
        limit = t - self._T_sat + 1e-9
        while len(self._since) > 1 and self._since[1][0] <= limit:
            self._since.popleft()
        at, did = self._since[0]
        return side if at <= limit and (does - did) * side < 0.5 * abs(short) else 0


def gains_in_force(gains: Gains, handling: Handling) -> Gains:
    """Gains and limits with which the law is called.

    Examples
    --------
    >>> gains_in_force(Gains(), Handling()) == Gains()
    True
    >>> gains_in_force(Gains(beta_GFM=0.5), Handling(weights="degree-normalised", beta_c=8.0)).beta_GFM
    4.0
    """
    if handling.weights == "degree-normalised":
        gains = replace(gains, beta_GFM=gains.beta_GFM * handling.beta_c, beta_GFL=gains.beta_GFL * handling.beta_c)
    if handling.anti_windup == "none":
        gains = replace(gains, P_set_min=-P_NONSENSE, P_set_max=P_NONSENSE, V_set_min=0.0, V_set_max=V_NONSENSE)
    return gains
