"""Check of power balance: what inverters generate is what loads and losses take, by the power flow of each island.

A row has P, Q and V of every inverter. One grid-forming inverter of each island keeps its terminal voltage here, the
others deliver their recorded P and Q, and the feeder's tables say what its lines and loads take, but for loads that
were set in the run. What is left for the one inverter is generation as it should be; the row says what it was.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np

from gridpeers.plant.dynamics.circuit import PHASES, Circuit
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.power_flow_at_rest import InverterPowerFlow
from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.named_loads import with_powers
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.plant import installed_inverters
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.simulators import SIMULATORS
from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.scenarios.results.island_membership import closed_switches
from gridpeers.wire.schema.table_schema import Plausible, Unit

MOST_NODES = 1500  # Nodes above which a feeder takes seconds
NEAR, MOST_CORRECTIONS = 1e-6, 20  # Difference (pu) from the row's terminal voltage at which to end
FIRST = 0.1  # Part of the difference by which the internal voltage is corrected at first; then the secant says how far
KEPT = 32  # Number of factored networks to keep: loads of a long run may change hundreds of times


class NetworkState(NamedTuple):
    """Switches and loads of a feeder at a time of a run."""

    closed: frozenset[str]
    powers: frozenset[tuple[str, complex]] = frozenset()
    """Loads that have another power at nominal voltage (VA) than in the tables, by name."""


class IslandBalance(NamedTuple):
    """Generation of one island in one row, beside what its loads and losses take."""

    inverters: tuple[str, ...]
    generated: complex
    """Power that its inverters delivered (VA)."""
    taken: complex
    """Power that loads and losses take at the voltages of that row (VA)."""


class IslandPowerFlow:
    """Power flows of one feeder; each state of switches and inverters is factored once."""

    def __init__(self, feeder: Tables, names: tuple[str, ...], settings: PlantSettings) -> None:
        spares = [row.name for row in feeder.spares if row.name in names]
        self.network = Network(feeder, spares=spares)
        self._at = [names.index(unit.name) for unit in self.network.inverters]
        self._units = installed_inverters(self.network, settings)
        self._circuit = lru_cache(maxsize=KEPT)(self._circuit_in)
        self._flow = lru_cache(maxsize=KEPT)(self._flow_in)

    def balances(self, state: NetworkState, P: Floats, Q: Floats, V: Floats, present: Flags) -> list[IslandBalance]:
        """Return the balance of each island without the substation that has a three-phase grid-forming inverter.

        Raise RuntimeError if no state of the network has these powers (`gridpeers.plant.dynamics.PlantError`).
        """
        P, Q, V, online = P[self._at], Q[self._at], V[self._at], present[self._at]
        flow, units = self._flow(state, tuple(online.tolist()))
        reduction = flow.reduction
        forming = np.flatnonzero(units.forming & ~units.single & reduction.online)
        islands, first = np.unique(reduction.inverter_island[forming], return_index=True)
        swings = [int(i) for island, i in zip(islands, forming[first], strict=True) if not reduction.has_source[island]]
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
            names = tuple(self.network.inverters[i].name for i in members)
            found.append(IslandBalance(names, generated, taken))
        return found

    def _circuit_in(self, state: NetworkState) -> Circuit:
        network = self.network
        if state.powers:
            network = network.with_loads(with_powers(network.feeder, dict(state.powers)))
        return circuit_of(network, state.closed, network.loads())

    def _flow_in(self, state: NetworkState, online: tuple[bool, ...]) -> tuple[InverterPowerFlow, Inverters]:
        units = Inverters(self._units, list(online))
        return InverterPowerFlow(self._circuit(state), units, np.zeros(len(units), bool)), units


_latest: list[tuple[Tables, tuple[str, ...], PlantSettings, IslandPowerFlow]] = []
"""The power flows of the last feeder: the cases of a run have one in common."""


class PowerBalance(Check):
    """In each island, generation is load plus losses: the power flow of the feeder's tables has the recorded powers.

    The rows are those in the middle and at the end of each window. A load that was set, by the scenario or by hand, has
    the power that its event says. A row with the substation cannot be judged: the record does not have the substation's
    power.
    """

    tolerance_percent: Annotated[float, Unit("%"), Plausible("a tolerance", 1e-6, 100.0, above_zero=True)] = 0.5
    """Largest difference, of real or of reactive power (% of the island's apparent power)."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        flows, history, judged = _flows_of(case), case.history, 0
        worst: dict[tuple[str, str], Violation] = {}
        for row in _rows(case):
            t, values = float(history.t[row]), (history.P[row], history.Q[row], history.V[row], history.present[row])
            try:
                balances = flows.balances(_state_at(case, t), *values)
            except RuntimeError as error:
                yield Violation(text=f"no state of the network has the recorded powers: {error}", t=t)
                continue
            judged += len(balances)
            for balance in balances:
                off, size, name = balance.generated - balance.taken, abs(balance.generated), balance.inverters[0]
                for kind, part in (("real power", off.real), ("reactive power", off.imag)):
                    found, before = 100.0 * abs(part) / size if size else 0.0, worst.get((name, kind))
                    if not found <= self.tolerance_percent and (before is None or found > (before.value or 0.0)):
                        text = f"generation minus load and losses, {kind}, island of {name}"
                        limit = self.tolerance_percent
                        worst[name, kind] = Violation(text=text, t=t, agent=name, value=found, unit="%", limit=limit)
        if not judged and not worst:
            raise NotJudgedError("no recorded row has an island without the substation")
        yield from worst.values()


def _flows_of(case: CheckedCase) -> IslandPowerFlow:
    plant = case.scenario.plant
    simulator = SIMULATORS.resolve(plant.simulator)
    if simulator.elsewhere:
        raise NotJudgedError(f"the network is that of {simulator.words}, which only that knows")
    nodes = sum(len(bus.phases) for bus in case.feeder.buses)
    if nodes > MOST_NODES:
        raise NotJudgedError(f"the feeder has {nodes} nodes, more than the {MOST_NODES} that a verdict has time for")
    settings = PlantSettings(gfm=plant.gfm, gfl=plant.gfl)
    names = case.history.inverters
    if not (_latest and _latest[0][0] is case.feeder and _latest[0][1:3] == (names, settings)):
        _latest[:] = [(case.feeder, names, settings, IslandPowerFlow(case.feeder, names, settings))]
    return _latest[0][3]


def _rows(case: CheckedCase) -> list[int]:
    """Return the rows in the middle and at the end of each window; the last row of a run without events."""
    t = case.history.t
    found = []
    for window in case.windows:
        inside = np.flatnonzero(window.rows(t))
        found += [int(inside[inside.size // 2]), int(inside[-1])] if inside.size else []
    return found or [len(t) - 1]


def _state_at(case: CheckedCase, t: float) -> NetworkState:
    """Return switches and loads at a time (s), by the plant's events; a load takes its power after its event."""
    powers = {
        event.subject: complex(event.P, event.Q)
        for event in case.events
        if event.kind == "load" and event.t < t - 1e-9 and event.P is not None and event.Q is not None
    }
    until = (event for event in case.events if event.kind == "switch" and event.t <= t + 1e-9)
    return NetworkState(closed_switches(case.feeder, until), frozenset(powers.items()))
