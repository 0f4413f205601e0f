"""The inverters of one island under one rule of control, as arrays: predictions are made for them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gridpeers.agents.agent_config import Control, Gains
from gridpeers.agents.graphs import in_neighbours
from gridpeers.plant.equipment import F_NOM, Feeder
from gridpeers.plant.equipment.inverter_parameters import GflParameters, GfmParameters, InverterParameters
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
    acts: Flags = field(default_factory=lambda: np.zeros(0, bool))
    """Which run the secondary law; the others keep their set-points. All, if left out."""
    shares: Flags = field(default_factory=lambda: np.zeros(0, bool))
    """Which have an agent: the sharing index is theirs, as in a run (`Nameplates.shares`). All, if left out."""
    s: Floats = field(default_factory=lambda: np.zeros(0))
    m_p: Floats = field(default_factory=lambda: np.zeros(0))
    m_q: Floats = field(default_factory=lambda: np.zeros(0))
    gains: Gains = field(default_factory=Gains)
    """Of the law; its limits are not part of a linear model."""
    f_nom: float = F_NOM
    T_c: float = 0.02
    parameters: tuple[InverterParameters, ...] = ()
    """Of the plant's inverters; the defaults of their kind, if left out."""

    def __post_init__(self) -> None:
        n = len(self.names)
        defaults = {"acts": True, "shares": True, "s": 1.0, "m_p": 0.01, "m_q": 0.05}
        for name, value in defaults.items():
            if not getattr(self, name).size:
                object.__setattr__(self, name, np.full(n, value))
        if not self.parameters:
            kinds = tuple(GfmParameters() if forming else GflParameters() for forming in self.GFM.tolist())
            object.__setattr__(self, "parameters", kinds)
        if self.A.shape != (n, n):
            raise ValueError(f"A must be {n} x {n}, one row per name, got {self.A.shape}")

    @property
    def n(self) -> int:
        return len(self.names)

    @property
    def gfl(self) -> tuple[GflParameters, ...]:
        return tuple(it for it in self.parameters if isinstance(it, GflParameters))

    @property
    def T_p(self) -> float:
        """Time constant (s) of the sum of the GFM's filtered powers: the mean of their own ones by weight."""
        T_p = np.array([it.T_p for it in self.parameters if isinstance(it, GfmParameters)])
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
        """Return some of the inverters, e.g. those of an island; the others are not heard."""
        at = np.flatnonzero(which)
        arrays = {name: getattr(self, name)[at] for name in ("GFM", "acts", "shares", "s", "m_p", "m_q")}
        return replace(
            self,
            names=tuple(self.names[i] for i in at.tolist()),
            parameters=tuple(self.parameters[i] for i in at.tolist()),
            A=self.A[np.ix_(at, at)],
            **arrays,
        )


def inverter_group_of(
    scenario: ScenarioModel,
    feeder: Feeder,
    case: str,
    *,
    roster: Collection[str] | None = None,
    island: Collection[str] | None = None,
) -> InverterGroup:
    """Return the inverters of one case of a scenario.

    The graph's rule is applied to the roster, who takes part in the run: those of the start, if left out. Of an island,
    the others are not heard.
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
