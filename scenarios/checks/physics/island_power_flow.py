"""The power flow of islands from what a row of a run says of their inverters: what loads and losses take.

A row has P, Q and V of every inverter. One grid-forming inverter of each island keeps its terminal voltage here, the
others deliver their recorded P and Q, and the feeder's tables say what its lines and loads take, but for loads that
were set in the run. What is left for the one inverter is generation as it should be; the row says what it was.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.phasors import PHASES
from gridpeers.plant.dynamics.start.power_flow import PowerFlow
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.named_loads import with_powers
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.installed_inverters import installed_inverters
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.scenarios.results.history import Flags, Floats

MOST_NODES = 1500
"""Nodes above which a feeder takes seconds."""

NEAR, MOST_CORRECTIONS = 1e-6, 20
"""Difference (pu) of a terminal voltage from that of the row at which to end, and most corrections until then."""

FIRST = 0.1
"""Part of the difference by which the internal voltage is corrected at first; then the secant says how far."""

KEPT = 32
"""Number of factored networks to keep: loads of a long run may change hundreds of times."""

Key = TypeVar("Key")
Value = TypeVar("Value")


class NetworkState(NamedTuple):
    """Switches and loads of a feeder at a time of a run."""

    closed: frozenset[str]
    """Names of the closed switches."""
    powers: frozenset[tuple[str, complex]] = frozenset()
    """Loads that have another power at nominal voltage (VA) than in the tables, by name."""


class IslandBalance(NamedTuple):
    """Generation of one island in one row, beside what its loads and losses take."""

    inverters: tuple[int, ...]
    """Positions of its inverters."""
    generated: complex
    """Power that its inverters delivered (VA)."""
    taken: complex
    """Power that loads and losses take at the voltages of that row (VA)."""


class IslandPowerFlow:
    """Power flows of one feeder; each state of switches and inverters is factored once.

    Parameters
    ----------
    feeder : Feeder
        As run.
    names : tuple[str, ...]
        Inverters, in the order of the rows' columns.
    settings : PlantSettings
        Parameters of the inverters.
    """

    def __init__(self, feeder: Feeder, names: tuple[str, ...], settings: PlantSettings) -> None:
        spares = [row.name for row in feeder.spares if row.name in names]
        self.network = Network(feeder, spares=spares)
        self._at = [names.index(unit.name) for unit in self.network.inverters]
        self._units = installed_inverters(self.network, settings)
        self._circuits: dict[NetworkState, Circuit] = {}
        self._flows: dict[tuple[NetworkState, bytes], tuple[PowerFlow, Inverters]] = {}

    def balances(self, state: NetworkState, P: Floats, Q: Floats, V: Floats, present: Flags) -> list[IslandBalance]:
        """Return the balance of each island without the substation that has a three-phase grid-forming inverter.

        Parameters
        ----------
        state
            Closed switches, and loads with another power than that of the tables.
        P, Q, V, present
            The row: powers (W, var), terminal voltages (V), and which inverters are on the network.

        Raises
        ------
        RuntimeError
            If no state of the network has these powers (`gridpeers.plant.dynamics.PlantError`).
        """
        P, Q, V, online = P[self._at], Q[self._at], V[self._at], present[self._at]
        flow, units = self._flow(state, online)
        reduction = flow.reduction
        swings = [
            int(of[0])
            for island in np.unique(reduction.inverter_island[reduction.online])
            if not reduction.has_source[island]
            for of in [np.flatnonzero(self._forming(units, reduction.online) & (reduction.inverter_island == island))]
            if of.size
        ]
        if not swings:
            return []
        frozen = np.zeros(len(units), bool)
        frozen[swings] = True
        S = P + 1j * Q
        I = np.conj(np.where(units.single, 3.0, 1.0) * S / (3.0 * np.where(V > 0.0, V, 1.0)))  # noqa: E741  # current
        J = (flow.y * V + np.where(online, I, 0.0))[:, None] * PHASES
        before = step = np.zeros(len(swings))
        for correction in range(MOST_CORRECTIONS):
            J, at_terminals = flow.solve(J, P / units.S_b, Q / units.S_b, frozen)
            off = V[swings] / np.abs(at_terminals[swings]).mean(axis=1) - 1.0  # unbalanced phases shift the mean
            if np.abs(off).max() < NEAR:
                break
            change = before - off  # followers of constant power can make it many times the step
            secant = np.divide(off, change, out=np.zeros_like(off), where=change != 0.0)
            step = secant * step if correction else FIRST * off
            J[swings] *= 1.0 + step[:, None]
            before = off
        delivered = np.sum(at_terminals * np.conj(J - flow.y[:, None] * at_terminals), axis=1)
        found = []
        for swing in swings:
            members = np.flatnonzero(reduction.online & (reduction.inverter_island == reduction.inverter_island[swing]))
            generated = complex(S[members].sum())
            taken = generated - complex(S[swing]) + complex(delivered[swing])
            found.append(IslandBalance(tuple(self._at[i] for i in members), generated, taken))
        return found

    def _forming(self, units: Inverters, online: Flags) -> Flags:
        whole: Flags = units.forming & ~units.single & online
        return whole

    def _flow(self, state: NetworkState, online: Flags) -> tuple[PowerFlow, Inverters]:
        key = state, online.tobytes()
        if key not in self._flows:
            if state not in self._circuits:
                _make_room(self._circuits)
                network = self.network
                if state.powers:
                    network = network.with_loads(with_powers(network.feeder, dict(state.powers)))
                self._circuits[state] = circuit_of(network, state.closed, network.loads())
            _make_room(self._flows)
            units = Inverters(self._units, online.tolist())
            self._flows[key] = PowerFlow(self._circuits[state], units, np.zeros(len(units), bool)), units
        return self._flows[key]


def _make_room(kept: dict[Key, Value]) -> None:
    """Drop the oldest entry if there are too many."""
    if len(kept) == KEPT:
        del kept[next(iter(kept))]
