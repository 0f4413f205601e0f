r"""The whole loop, law and plant, as one linear map from tick to tick, with delays in ticks and losses.

The law is that of `gridpeers.agents.laws.consensus`, not the continuous one. With a_i = `towards`(kappa_i, d_i, T_c)
and b_i = 1 - exp(-kappa_i T_c):

.. math:: y_i(k) = y_i(k-1) + a_i \big(\bar y_i - y_i(k-1-o)\big) - g_i b_i e(k - m)

where the mean is over y_j(k-1-n_ij). Delays in whole ticks: n_ij of a link beyond the one period that every state
takes, m of the measurement (one of the set-point on its way to the plant is the same to the loop), o of the own value
in the comparison.

**Loss.** Of a lossy link the last value received is held. If each message is lost with probability p by itself, its
mean obeys exactly H(k) = (1-p) y_j(k-1-n) + p H(k-1), as the draw is independent of what was sent. Its mean age is that
of a delay of p/(1-p) ticks. The model follows the means; how far one run strays from them it does not tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gridpeers.agents.laws.consensus import towards
from gridpeers.lab.predict.closed_form import DelayKind
from gridpeers.lab.predict.inverter_group import InverterGroup, PlantModel, response
from gridpeers.scenarios.results.history import Floats

LinkEnds = tuple[str, str]

AT_REST = 1e-9  # Singular values of 1 - M below this belong to set-points that the law never moves


@dataclass(frozen=True, kw_only=True)
class Ticks:
    """Delays in control periods, and losses; a number holds for all links, a mapping for those that it names."""

    link: int | Mapping[LinkEnds, int] = 0
    """Of neighbours' states beyond the one period they always take, by (src, dst)."""
    measurement: int = 0
    own: int = 0
    """Of the own value where it is compared with the neighbours'; a correct agent has 0."""
    loss: float | Mapping[LinkEnds, float] = 0.0
    """Probability that a state is lost, by (src, dst); the last one heard is held."""


@dataclass(frozen=True)
class Path:
    t: Floats
    e: Floats
    power: Floats
    """m_p p of each inverter (pu frequency), shape (T, N)."""
    set_point: Floats
    """m_p P_set of each inverter (pu frequency), shape (T, N)."""


class _Delays(NamedTuple):
    link: NDArray[np.int64]
    loss: Floats
    lossy: list[tuple[int, int]]
    """(receiver, sender) of links that lose and carry something."""
    depth: int
    """H: how many past set-points of everybody the loop needs."""


@dataclass(frozen=True, kw_only=True)
class Loop:
    inverters: InverterGroup
    ticks: Ticks = field(default_factory=Ticks)
    plant: PlantModel = "lagged"
    muted: int = 0
    """Links with at least so many ticks of delay carry nothing yet; 0: all do. For the ticks after an islanding."""

    @cached_property
    def _delays(self) -> _Delays:
        ticks, names = self.ticks, self.inverters.names
        link, loss = (
            np.array([[of.get((src, dst), 0) if isinstance(of, Mapping) else of for src in names] for dst in names])
            for of in (ticks.link, ticks.loss)
        )
        if (least := min(ticks.own, ticks.measurement, link.min())) < 0:
            raise ValueError(f"a delay is a whole number of control periods, 0 or more, got {least}")
        if wrong := [p for p in loss.flat if not 0.0 <= p < 1.0]:
            raise ValueError(f"loss is a probability from 0 to below 1, got {wrong[0]:g}; write 0.3 for 30 %")
        lossy = [(i, j) for i, j in np.argwhere((loss > 0.0) & (self.inverters.heard > 0.0)).tolist()]
        return _Delays(link, loss, lossy, depth=1 + max(ticks.own, int(link.max())))

    @property
    def _heard(self) -> Floats:
        if not self.muted:
            return self.inverters.heard
        return np.where(self._delays.link < self.muted, self.inverters.heard, 0.0)

    @property
    def gains(self) -> tuple[Floats, Floats]:
        """Law's factors a_i (part of the way to the neighbours' mean) and g_i b_i (of the frequency error)."""
        inverters = self.inverters
        pairs = zip(inverters.kappa.tolist(), self._heard.sum(axis=1).tolist(), strict=True)
        a = np.array([towards(kappa, d, inverters.T_c) for kappa, d in pairs])
        return a, np.where(inverters.leads, 1.0 - np.exp(-inverters.kappa * inverters.T_c), 0.0)

    @cached_property
    def _built(self) -> tuple[Floats, Floats, Floats]:
        """Map of the state, and the rows that read e and the powers from it.

        The state: y(k-1), ..., y(k-H); x(k); e(k-1), ..., e(k-M); held values; the load.
        """
        inverters, plant, own = self.inverters, response(self.inverters, self.plant), self.ticks.own
        link, loss, lossy, H = self._delays
        n, states, M = inverters.n, len(plant.A), self.ticks.measurement
        x0 = H * n
        e0, held0 = x0 + states, x0 + states + M
        load = held0 + len(lossy)
        one = np.eye(load + 1)
        y, x = one[:x0].reshape(H, n, -1), one[x0:e0]
        e_now = plant.C @ x + plant.D @ y[0] + plant.F * one[load]
        powers = plant.C_p @ x + plant.D_p @ y[0] + np.outer(plant.F_p, one[load])

        held = {}
        for k, (i, j) in enumerate(lossy):
            held[i, j] = (1.0 - loss[i, j]) * y[link[i, j], j] + loss[i, j] * one[held0 + k]

        (a, b), audible, new = self.gains, self._heard, y[0].copy()
        degree = audible.sum(axis=1)
        for i in np.flatnonzero(degree).tolist():
            new[i] -= a[i] * y[own, i]
            for j in np.flatnonzero(audible[i]).tolist():
                new[i] += (a[i] * audible[i, j] / degree[i]) * held.get((i, j), y[link[i, j], j])
        new -= np.outer(b, one[e0 + M - 1] if M else e_now)
        moved = plant.A @ x + plant.B @ new + np.outer(plant.E, one[load])
        rows = [*new, *one[: (H - 1) * n], *moved]
        rows += [e_now, *one[e0 : held0 - 1]] if M else []
        rows += [*held.values(), one[load]]
        return np.array(rows), e_now, powers

    @property
    def matrix(self) -> Floats:
        return self._built[0]

    @cached_property
    def free_map(self) -> Floats:
        matrix = self.matrix
        frozen = np.zeros(matrix.shape[0], bool)
        frozen[-1] = True
        frozen[: self._delays.depth * self.inverters.n] = np.tile(~self.inverters.acts, self._delays.depth)
        keep = np.flatnonzero(~frozen)
        return np.asarray(matrix[np.ix_(keep, keep)])

    @cached_property
    def resting(self) -> int:
        """How many combinations of set-points the law never moves: 0 where frequency and sharing both come back.

        One for each further group that nothing connects with the leaders' frequency; delays do not change it.
        """
        free = Loop(inverters=self.inverters, plant="quasi-steady").free_map
        singular = np.linalg.svd(np.eye(len(free)) - free, compute_uv=False)
        return int((singular < AT_REST).sum())

    @cached_property
    def spectral_radius(self) -> float:
        """Largest magnitude of an eigenvalue (1), without set-points that never move; below 1 the loop is stable."""
        values = np.linalg.eigvals(self.free_map)
        values = values[np.argsort(np.abs(values - 1.0))][self.resting :]
        return float(np.abs(values).max(initial=0.0))

    @property
    def stable(self) -> bool:
        return self.spectral_radius < 1.0 - 1e-12

    def run(self, ticks: int, start: Floats, load: float, *, islanding: bool = False) -> Path:
        """Return the response to a step of the load at t = 0, from rest at nominal frequency.

        `start`: m_p P_set of each; `load`: mean m_p p after the step (both pu frequency); `islanding`: the step creates
        an island, so agents leave out states from before it, but at the very tick of the change. Then a link with n
        ticks of delay carries nothing at the ticks 2 to n + 1. The measurement of the event's own tick is taken before
        the event, so the next one is the first to show it.
        """
        matrix, e_row, power_rows = self._built
        plant, inverters = response(self.inverters, self.plant), self.inverters
        n, states, H, lossy = inverters.n, len(plant.A), self._delays.depth, self._delays.lossy
        z = np.zeros(matrix.shape[0])
        z[: H * n] = np.tile(start, H)
        x = plant.rest(start, float(inverters.weight @ start))
        z[H * n : H * n + states] = plant.A @ x + plant.B @ start + plant.E * load
        if lossy:
            z[-1 - len(lossy) : -1] = start[[j for _, j in lossy]]
        z[-1] = load
        e, powers, set_points = np.zeros(ticks), np.zeros((ticks, n)), np.zeros((ticks, n))
        step = sp.csr_array(matrix)
        longest = int(self._delays.link.max()) if islanding else 0
        steps = {n: sp.csr_array(replace(self, muted=n).matrix) for n in range(1, longest + 1)}
        for k in range(ticks):
            e[k], powers[k] = e_row @ z, power_rows @ z
            z = steps.get(k, step) @ z  # this is tick k + 1, and mute are links with n >= k
            set_points[k] = z[:n]
        t: Floats = np.arange(1.0, ticks + 1.0) * inverters.T_c
        return Path(t, e, powers, set_points)


# -------------------------------------------------------------------- limits of delay


ANGLES = 600


def delay_limit(
    inverters: InverterGroup, kind: DelayKind | str, *, plant: PlantModel = "lagged", longest_s: float = 3.0
) -> float:
    """Return the longest delay (s), the same for all, up to which the loop in discrete time is stable.

    "neighbours" is from agent to agent with a fresh own value; in "disagreement" the own value is as late; "local loop"
    is from the plant to an agent, or back, which are the same to the loop. The limit is a multiple n T_c (s): stable
    with it, unstable with any more, as the next tick is then the first to use what comes. Infinite if none was found up
    to `longest_s`, which for "neighbours" is mostly at any delay (`first_crossing`). Not a number if the loop is
    unstable without delay.
    """
    ticks = {
        "neighbours": lambda n: Ticks(link=n),
        "disagreement": lambda n: Ticks(link=n, own=n),
        "local loop": lambda n: Ticks(measurement=n),
    }
    if kind not in ticks:
        raise ValueError(f'no kind of delay "{kind}"; kinds are {", ".join(ticks)}')
    if not Loop(inverters=inverters, plant=plant).stable:
        return math.nan
    if kind != "local loop" and not inverters.heard.any():
        return math.inf
    first = 1.0
    if kind == "neighbours":  # long delays make large matrices: begin where the sweep says that something happens
        first = max(1.0, 0.9 * first_crossing(inverters, plant=plant) - 1.0)
    unmoved = 1 if kind != "local loop" else 0  # every state takes one period in any case
    last = round(longest_s / inverters.T_c)
    for n in range(math.floor(min(first, last + 1.0)), last + 1):
        if not Loop(inverters=inverters, ticks=ticks[kind](n), plant=plant).stable:
            return (n - 1 + unmoved) * inverters.T_c
    return math.inf


def first_crossing(inverters: InverterGroup, *, plant: PlantModel = "lagged") -> float:
    """Return shortest delay (control periods) of the neighbours' states, the same on all links, at which a mode stays.

    With own values apart from the neighbours' the loop is F(z) y = z^{-n} S y. A mode can stand on the unit circle, z =
    exp(j theta), only where an eigenvalue of F^{-1} S has magnitude 1; its angle then is n theta. Infinite if there is
    none on `ANGLES` angles: then no delay destabilises the loop.

    References
    ----------
    Chen, Latchman, IEEE Trans. Autom. Control 40(9), 1995: frequency sweeping tests, in continuous time.
    """
    acts, n, held = inverters.acts, inverters.n, response(inverters, plant)
    a, b = Loop(inverters=inverters).gains
    share = (a / np.maximum(inverters.degree, 1.0))[:, None] * inverters.heard
    shortest, before = math.inf, np.zeros(int(acts.sum()))
    for theta in np.geomspace(1e-3, math.pi, ANGLES):
        z = np.exp(1j * theta)
        x = np.linalg.solve(np.eye(len(held.A)) - held.A / z, held.B)
        F = (z - 1.0) * np.eye(n) + np.diag(a) + np.outer(b, held.C @ x + held.D)
        reach = np.linalg.eigvals(np.linalg.solve(F[np.ix_(acts, acts)], share[np.ix_(acts, acts)]))
        reach = reach[np.argsort(np.abs(reach))]
        crossed = (np.abs(reach) >= 1.0) != (before >= 1.0)
        turns = np.mod(np.angle(reach[crossed]), 2.0 * math.pi) / theta
        shortest = min(shortest, float(turns.min(initial=math.inf)))
        before = np.abs(reach)
    return shortest
