"""The inverters of one island under one rule of control, as arrays: predictions are made for them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from gridpeers.agents.agent_config import Control, Gains
from gridpeers.agents.graphs import in_neighbours
from gridpeers.plant.equipment import Tables
from gridpeers.plant.inverters.inverter_model import DroopLag, FollowerLag, InverterModel
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of, without_agent


@dataclass(frozen=True, kw_only=True)
class InverterGroup:
    names: tuple[str, ...]
    GFM: Flags
    """Which are grid-forming: the leaders, g_i = 1."""
    A: Floats
    """Adjacency c_ij (1), row = receiver."""
    acts: Flags
    """Which run the secondary law; the others keep their set-points."""
    shares: Flags
    """Which have an agent: the sharing index is theirs, as in a run (`Nameplates.shares`)."""
    s: Floats
    m_p: Floats
    m_q: Floats
    gains: Gains
    """Of the law; its limits are not part of a linear model."""
    f_nom: float
    T_c: float
    parameters: tuple[InverterModel, ...]

    @property
    def n(self) -> int:
        return len(self.names)

    @property
    def followers(self) -> tuple[FollowerLag, ...]:
        return tuple(lag for lag in map(response_of, self.parameters) if isinstance(lag, FollowerLag))

    @property
    def T_p(self) -> float:
        """Time constant (s) of the sum of the GFM's filtered powers: the mean of their own ones by weight."""
        T_p = np.array([lag.T_p for lag in map(response_of, self.parameters) if isinstance(lag, DroopLag)])
        own = self.weight[self.GFM]
        return float(T_p[0] if (T_p == T_p[0]).all() else T_p @ own / own.sum())

    @property
    def leads(self) -> Flags:
        leads: Flags = self.GFM & self.acts
        return leads

    @property
    def kappa(self) -> Floats:
        return self.m_p / self.gains.k_p

    @property
    def weight(self) -> Floats:
        """Part w_i of each inverter in the frequency, (s_i/m_i) / sum (s_j/m_j): e = sum w_i y_i - load."""
        part = self.s / self.m_p
        return np.asarray(part / part.sum())

    @property
    def heard(self) -> Floats:
        """Links that carry something into the law: rows of those that run it."""
        return np.where(self.acts[:, None], self.A, 0.0)

    @property
    def degree(self) -> Floats:
        return np.asarray(self.heard.sum(axis=1))

    def part(self, which: NDArray[np.bool_]) -> InverterGroup:
        at = np.flatnonzero(which)
        arrays = {name: getattr(self, name)[at] for name in ("GFM", "acts", "shares", "s", "m_p", "m_q")}
        return replace(
            self,
            names=tuple(self.names[i] for i in at.tolist()),
            parameters=tuple(self.parameters[i] for i in at.tolist()),
            A=self.A[np.ix_(at, at)],
            **arrays,
        )


def response_of(model: InverterModel) -> DroopLag | FollowerLag:
    """Return a model's linear response; ValueError says that it has none, so that nothing can be predicted."""
    found = model.response()
    if found is None:
        raise ValueError(
            f'the model "{model.model}" has no linear response (`InverterModel.response`), by which predictions are '
            "made; run it instead"
        )
    return found


def inverter_group_of(
    scenario: ScenarioModel,
    feeder: Tables,
    case: str,
    *,
    roster: Collection[str] | None = None,
    island: Collection[str] | None = None,
) -> InverterGroup:
    """Return the inverters of one case of a scenario.

    `roster`: inverters that take part, to which the graph's rule is applied; by default those of the start. `island`:
    inverters that are heard; by default all.
    """
    present = {row.name for row in feeder.inverters} if roster is None else set(roster)
    rows = {row.name: row for row in inverters_of(scenario, feeder) if row.name in present}
    _, agents = configs(scenario, feeder, case)
    control = agents[0].control if agents else Control(secondary="none", graph="none")
    without = without_agent(scenario, case)
    A = np.zeros((len(rows), len(rows)))
    at = [i for i, name in enumerate(rows) if name not in without]
    members = {name: rows[name] for name in rows if name not in without}
    heard = {name: in_neighbours(control, name, members) for name in members}
    A[np.ix_(at, at)] = np.array([[float(other in heard[name]) for other in members] for name in members])
    inverters = InverterGroup(
        names=tuple(rows),
        GFM=np.array([row.kind == "GFM" for row in rows.values()], bool),
        A=A,
        acts=np.array([control.acts(name, row.kind) and name not in without for name, row in rows.items()], bool),
        shares=np.array([name not in without for name in rows], bool),
        s=np.array([row.P_rated for row in rows.values()]),
        m_p=np.array([row.m_p for row in rows.values()]),
        m_q=np.array([row.m_q for row in rows.values()]),
        gains=scenario.cases[case].gains,
        f_nom=feeder.f_nom,
        T_c=scenario.time.T_c_s,
        parameters=tuple(feeder.parameters_of(row, scenario.plant.gfm, scenario.plant.gfl) for row in rows.values()),
    )
    return inverters if island is None else inverters.part(np.array([name in island for name in rows], bool))


# -------------------------------------------------------------------- the plant as the secondary law feels it


PlantModel = Literal["lagged", "quasi-steady"]


@dataclass(frozen=True, kw_only=True)
class Response:
    r"""Plant between two ticks: x(k+1) = A x(k) + B u(k) + E l, and at tick k e = C x + D u + F l with u of before.

    Powers: pi = C_p x + D_p u + F_p l in the same way. With N inverters and n states, A is n x n, B n x N, C_p N x n.

    Everything is a pu frequency: set-points y = m_p P_set, powers pi = m_p p, the load l = P_load / sum (s_i/m_i). The
    GFM (set F) share the rest of the load, by their weights w_i, so that all have the same frequency:

    .. math:: w_F e = \sum_F w_i y_i - u, \qquad T_p \dot u = l - \sum_{GFL} w_j \pi_j - u

    where u is what the GFM's filtered powers add up to. A GFL sees e through its PLL and its frequency filter, and its
    power lags (plant/inverters/gfl.py):

    .. math:: \dot\delta = e - f, \quad f = k_p \delta + \zeta, \quad \dot\zeta = k_i \delta, \quad
              T_{ff} \dot\phi = f - \phi, \quad T_{pf} \dot\pi_j = y_j - \phi - \pi_j

    Left out: power limits, voltages (loads are constant power), the angles' swing among the GFM, current controllers,
    dead bands. Without the lags ("quasi-steady") e = sum w_i y_i - l.
    """

    A: Floats
    B: Floats
    E: Floats
    C: Floats
    D: Floats
    F: float
    C_p: Floats
    D_p: Floats
    F_p: Floats

    def rest(self, u: Floats, load: float) -> Floats:
        """Return the steady state of the plant under set-points u and a load (both pu frequency)."""
        return np.asarray(np.linalg.solve(np.eye(len(self.A)) - self.A, self.B @ u + self.E * load))


def response(inverters: InverterGroup, plant: PlantModel = "lagged") -> Response:
    if not inverters.GFM.any():
        raise ValueError(f"no GFM among {', '.join(inverters.names)}: their island has no voltage; give it one")
    return _quasi_steady(inverters) if plant == "quasi-steady" else _lagged(inverters)


def _quasi_steady(inverters: InverterGroup) -> Response:
    n, w = inverters.n, inverters.weight
    lags = map(response_of, inverters.parameters)
    follows = np.array([isinstance(lag, DroopLag) or lag.frequency_watt for lag in lags], float)
    stiffness = float(w @ follows)
    D, F = w / stiffness, -1.0 / stiffness
    return Response(
        A=np.zeros((0, 0)),
        B=np.zeros((0, n)),
        E=np.zeros(0),
        C=np.zeros(0),
        D=D,
        F=F,
        C_p=np.zeros((n, 0)),
        D_p=np.eye(n) - np.outer(follows, D),
        F_p=-follows * F,
    )


def _lagged(inverters: InverterGroup) -> Response:
    n, w, followers = inverters.n, inverters.weight, inverters.followers
    forming, following = np.flatnonzero(inverters.GFM), np.flatnonzero(~inverters.GFM)
    w_F = float(w[forming].sum())
    locks = dict.fromkeys((it.k_pPLL, it.k_iPLL, it.T_ff) for it in followers)  # GFL with equal ones see the same
    phi_of = {lock: 3 + 3 * k for k, lock in enumerate(locks)}
    u, first = 0, 1 + 3 * len(locks)
    size = first + following.size
    powers = first + np.arange(following.size)

    C, D = np.zeros(size), np.zeros(n)
    C[u], D[forming] = -1.0 / w_F, w[forming] / w_F

    A, B, E = np.zeros((size, size)), np.zeros((size, n)), np.zeros(size)
    A[u, u], A[u, powers], E[u] = -1.0, -w[following], 1.0
    A[u], E[u] = A[u] / inverters.T_p, E[u] / inverters.T_p
    for (k_p, k_i, T_ff), phi in phi_of.items():
        delta, zeta = phi - 2, phi - 1
        A[delta], B[delta] = C, D
        A[delta, delta] -= k_p
        A[delta, zeta] -= 1.0
        A[zeta, delta] = k_i
        A[phi, [delta, zeta, phi]] = k_p / T_ff, 1.0 / T_ff, -1.0 / T_ff
    for power, unit, it in zip(powers, following, followers, strict=True):
        A[power, phi_of[it.k_pPLL, it.k_iPLL, it.T_ff]] = -1.0 / it.T_pf if it.frequency_watt else 0.0
        A[power, power] = -1.0 / it.T_pf
        B[power, unit] = 1.0 / it.T_pf

    whole = np.zeros((size + n + 1, size + n + 1))
    whole[:size] = np.hstack([A, B, E[:, None]])
    held = expm(whole * inverters.T_c)[:size]

    C_p, D_p = np.zeros((n, size)), np.zeros((n, n))
    C_p[forming], D_p[forming] = -C, -D
    D_p[forming, forming] += 1.0
    C_p[following, powers] = 1.0
    return Response(
        A=held[:, :size], B=held[:, size:-1], E=held[:, -1], C=C, D=D, F=0.0, C_p=C_p, D_p=D_p, F_p=np.zeros(n)
    )
