"""The network of a feeder as matrices over its nodes."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Mapping
from copy import copy
from functools import cached_property
from itertools import compress
from math import pi, sqrt

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.kernel.compiled import Complex, Integers, Real
from gridpeers.plant.equipment import PHASES, InverterRow, Regulator, Switch, Tables
from gridpeers.plant.equipment.connectivity import bus_islands, switch_name
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.plant.equipment.neutrals import neutrals_of
from gridpeers.plant.network.loads import LoadBranches, law_row
from gridpeers.plant.network.merging import Merge, line_admittance, merge_nodes, transformer_admittance
from gridpeers.wire.wording import first_of

ANGLE = {"A": 0.0, "B": -2.0 * pi / 3.0, "C": 2.0 * pi / 3.0}  # nominal angles of the phases (rad)

DELTA_PAIRS = (("A", "B"), ("B", "C"), ("C", "A"))


class Network:
    """Nodes, switches and admittances of a feeder. Pure: every method is a function of the tables and of `closed`.

    Nodes are (bus, phase), in the order of the feeder's table. Voltages are line-to-ground phasors (V RMS) in one frame
    at nominal frequency. Switches and regulators tie nodes together (`merge`); in `admittance` only representatives
    have entries.

    `line_charging`: whether lines have shunt capacitance; `spares`: names of the spare inverters in this run.

    `V_nom`: nominal voltages (V, line-to-neutral); `nominal`: nominal phasors (V), in a feeder of `LinearElement`s
    those without load; `source_nodes`: nodes of the substation, which always represent themselves; `inverters`: spares
    last; `Y_branches`, `Y_capacitors`, `Y_loads`: parts of the admittance matrix (S) before merging.
    """

    def __init__(self, feeder: Tables, *, line_charging: bool = True, spares: Iterable[str] = ()) -> None:
        self.feeder = self._first = feeder
        self.line_charging = line_charging
        self.nodes = tuple((bus.name, phase) for bus in feeder.buses for phase in bus.phases)
        self._index = {node: i for i, node in enumerate(self.nodes)}
        self.V_nom: Real = np.array([bus.V_nom for bus in feeder.buses for _ in bus.phases])
        self.nominal: Complex = np.array(
            [cmath.rect(V, ANGLE.get(phase, 0.0)) for V, (_, phase) in zip(self.V_nom, self.nodes, strict=True)],
            dtype=np.complex128,
        )
        self.switches = {switch.name: switch for switch in feeder.switches}
        self.closed0 = frozenset(switch.name for switch in feeder.switches if switch.closed)
        self.inverters: tuple[InverterRow, ...] = feeder.inverters + _chosen(feeder, tuple(spares))
        source = feeder.source
        self.source_nodes: Integers = np.array(
            [self.index(source.bus, phase) for phase in PHASES] if source else [], dtype=np.int64
        )
        turned = cmath.rect(source.V_pu, source.angle) if source else 1.0
        self.source_voltage: Complex = self.nominal[self.source_nodes] * turned
        self.Y_branches = self._branches()
        self.Y_capacitors = self._capacitors()
        self.Y_loads = self._impedance_loads()
        self._Y = self.Y_branches + self.Y_capacitors + self.Y_loads
        if feeder.elements:
            self.nominal = self._without_load()
        self._wanted = [int(node) for node in self.source_nodes] + [
            self.index(inverter.bus, phase) for inverter in self.inverters for phase in inverter.phases
        ]

    @cached_property
    def neutrals(self) -> dict[str, str]:
        """Neutral of each bus that has one, by the first tables: loads of other powers move none."""
        return neutrals_of(self._first)

    def index(self, bus: str, phase: str) -> int:
        return self._index[bus, phase]

    def has(self, bus: str, phases: str) -> bool:
        return all((bus, phase) in self._index for phase in phases)

    def switch_name(self, text: str) -> str:
        return text if text in self.switches else switch_name(self.feeder, text)

    def merge(self, closed: frozenset[str]) -> Merge:
        """Return the nodes that these switches and the regulators merge.

        The node of a source or an inverter represents those that are merged with it.
        """
        return merge_nodes(self._node_names(), self._ties(closed), self._wanted)

    def admittance(self, closed: frozenset[str]) -> sp.csc_array:
        """Return the admittances (S) of branches, capacitors and impedance loads: T' Y T with T of `merge`."""
        T = self.merge(closed).matrix()
        Y = sp.csc_array(T.T @ self._Y @ T)
        Y.sum_duplicates()
        return Y

    def loads(self) -> LoadBranches:
        """Give the loads that are no impedances, at their own nodes (`LoadBranches.on` moves them)."""
        own = self._load_branches([load.model != "Z" for load in self.feeder.loads])
        parts = [part for part in self.feeder.load_parts if not part.is_impedance]
        return own + self._load_part_branches(parts) if parts else own

    def weak_loads(self, weak: Mapping[int, float]) -> str:
        """Say which loads the network cannot feed; `weak`: their branches, and short-circuit powers (VA)."""
        pairs = zip(self.feeder.loads, self._first.loads, strict=True)
        names = [load.bus for load, table in pairs if load.model != "Z" for S in table.S if S]
        names += [part.name for part in self.feeder.load_parts if not part.is_impedance]
        least: dict[str, float] = {}
        for branch, S in weak.items():
            least[names[branch]] = min(S, least.get(names[branch], S))
        if not least:
            return "the load may be more than the network can carry: try smaller loads"
        sizes = named_loads(self.feeder)
        told = [
            f"{name} at bus {sizes[name].bus} ({abs(sizes[name].S) / 1e3:.3g} kVA where the short-circuit power is "
            f"{least[name] / 1e3:.2g} kVA)"
            for name in least
        ]
        return (
            f"the network cannot feed the constant power of {first_of(told, 5)}: make it smaller, or a constant "
            "impedance; where nothing holds a voltage to ground, as behind a delta winding, ground it, or connect the "
            "load between phases"
        )

    def with_loads(self, feeder: Tables) -> Network:
        """Return the same network with other powers of loads; a load that is set to nothing keeps its branches."""
        other = copy(self)
        other.feeder = feeder
        other.Y_loads = other._impedance_loads()  # noqa: SLF001  its own class
        other._Y = other.Y_branches + other.Y_capacitors + other.Y_loads  # noqa: SLF001  its own class
        return other

    def islands(self, closed: frozenset[str]) -> tuple[frozenset[str], ...]:
        return bus_islands(self.feeder, closed)

    def _without_load(self) -> Complex:
        """Phasors (V) with all switches closed and no load: what transformers of any connection make of the source."""
        merge = merge_nodes(self._node_names(), self._ties(frozenset(self.switches)), self.source_nodes.tolist())
        T = merge.matrix()
        Y = sp.csc_matrix(T.T @ self.Y_branches @ T)
        used = np.flatnonzero(np.diff(Y.indptr) > 0)
        unknown = np.setdiff1d(used, self.source_nodes)
        V = np.zeros(len(self.nodes), np.complex128)
        V[self.source_nodes] = self.source_voltage
        right = -Y[unknown][:, self.source_nodes] @ self.source_voltage
        V[unknown] = splu(sp.csc_matrix(Y[unknown][:, unknown])).solve(right)
        V = merge.expand(V)
        return np.where(np.isfinite(V), V, self.nominal)

    def _node_names(self) -> list[str]:
        return [f"bus {bus} phase {phase}" for bus, phase in self.nodes]

    def _ties(self, closed: frozenset[str]) -> list[tuple[int, int, float]]:
        for name in closed - self.switches.keys():
            raise ValueError(f'closed switch "{name}" is not in Network.switches; pass it through switch_name')
        devices: list[tuple[Switch | Regulator, float]] = [
            (switch, 1.0) for name, switch in self.switches.items() if name in closed
        ]
        devices += [(regulator, regulator.ratio) for regulator in self.feeder.regulators]
        return [
            (self.index(device.from_bus, phase), self.index(device.to_bus, phase), ratio)
            for device, ratio in devices
            for phase in device.phases
        ]

    def _assemble(self, parts: list[tuple[list[int], Complex]]) -> sp.csc_array:
        n = len(self.nodes)
        rows = [np.repeat(nodes, len(nodes)) for nodes, _ in parts]
        columns = [np.tile(nodes, len(nodes)) for nodes, _ in parts]
        values = [matrix.ravel() for _, matrix in parts]
        if not parts:
            return sp.csc_array((n, n), dtype=np.complex128)
        return sp.csc_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n, n))

    def _branches(self) -> sp.csc_array:
        configs = {config.name: config for config in self.feeder.line_configs}
        voltage = {bus.name: bus.V_nom for bus in self.feeder.buses}
        parts = []
        for line in self.feeder.lines:
            nodes = [self.index(bus, phase) for bus in (line.from_bus, line.to_bus) for phase in line.phases]
            parts.append((nodes, line_admittance(line, configs[line.config], charging=self.line_charging)))
        for transformer in self.feeder.transformers:
            ends = (transformer.from_bus, transformer.to_bus)
            nodes = [self.index(bus, phase) for bus in ends for phase in PHASES]
            parts.append((nodes, transformer_admittance(transformer, voltage[ends[0]], voltage[ends[1]])))
        for element in self.feeder.elements:
            parts.append(([self.index(*node) for node in element.nodes], np.array(element.Y, dtype=np.complex128)))
        return self._assemble(parts)

    def _capacitors(self) -> sp.csc_array:
        parts = [
            ([self.index(bank.bus, phase)], np.array([[1j * Q / bank.V_rated**2]]))
            for bank in self.feeder.capacitors
            for phase, Q in zip(PHASES, bank.Q, strict=True)
            if Q
        ]
        return self._assemble(parts)

    def _impedance_loads(self) -> sp.csc_array:
        # A Z load comes out of _load_branches with its nominal power in S, as a constant-power load would.
        branches, n = self._load_branches([load.model == "Z" for load in self.feeder.loads]), len(self.nodes)
        Y = branches.admittance(n, np.conj(branches.law.S) / branches.V_nom**2)
        parts = [part for part in self.feeder.load_parts if part.is_impedance]
        if not parts:
            return Y
        of_parts, S = self._load_part_branches(parts), np.array([part.S for part in parts])
        return Y + of_parts.admittance(n, np.conj(S) / of_parts.V_nom**2)

    def _load_part_branches(self, parts: list[LoadPart]) -> LoadBranches:
        first = np.array([self.index(part.bus, part.ends[0]) for part in parts], np.int64)
        to = np.array([self.index(part.bus, part.ends[1]) if part.ends[1] else -1 for part in parts], np.int64)
        across = self.nominal[first] - np.where(to < 0, 0.0, self.nominal[to])
        none, rows = np.zeros(len(parts), np.complex128), np.array([law_row(part) for part in parts])
        return LoadBranches(
            n_from=first,
            n_to=to,
            law=LoadLaw(S=none, I0=none, limited_at=np.arange(len(parts)), law=rows),
            V_nom=np.array([part.V_nom for part in parts]),
            phi0=np.angle(across),
            a_from=np.ones(len(parts)),
            a_to=np.where(to < 0, 0.0, 1.0),
        )

    def _load_branches(self, chosen: list[bool]) -> LoadBranches:
        n_from, n_to, power, current, V_nom, phi0 = [], [], [], [], [], []
        for load, table in compress(zip(self.feeder.loads, self._first.loads, strict=True), chosen):
            pairs = DELTA_PAIRS if load.connection == "D" else tuple((phase, "") for phase in PHASES)
            for (first, second), S, S_table in zip(pairs, load.S, table.S, strict=True):
                if S_table == 0:
                    continue
                i = self.index(load.bus, first)
                n_from.append(i)
                n_to.append(self.index(load.bus, second) if second else -1)
                across = self.V_nom[i] * (sqrt(3.0) if second else 1.0)
                V_nom.append(across)
                phi0.append(ANGLE[first] + (pi / 6.0 if second else 0.0))
                power.append(0j if load.model == "I" else S)
                current.append(S.conjugate() / across if load.model == "I" else 0j)
        to = np.array(n_to, dtype=np.int64)
        return LoadBranches(
            n_from=np.array(n_from, dtype=np.int64),
            n_to=to,
            law=LoadLaw(S=np.array(power, dtype=np.complex128), I0=np.array(current, dtype=np.complex128)),
            V_nom=np.array(V_nom, dtype=np.float64),
            phi0=np.array(phi0, dtype=np.float64),
            a_from=np.ones(len(n_from)),
            a_to=np.where(to < 0, 0.0, 1.0),
        )


def _chosen(feeder: Tables, spares: tuple[str, ...]) -> tuple[InverterRow, ...]:
    known = {row.name: row for row in feeder.spares}
    for name in spares:
        if name not in known:
            raise ValueError(f'spare "{name}": no such spare inverter in "{feeder.name}"; there are {list(known)}')
    return tuple(row for name, row in known.items() if name in spares)
