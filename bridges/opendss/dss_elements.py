"""Linear elements of an OpenDSS circuit, as primitive admittances between nodes of ours."""

from __future__ import annotations

from math import radians, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.bridges.opendss.dss_engine import DssEngine
from gridpeers.plant.equipment import NODES, Bus, Source, Switch
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart, bus_behind
from gridpeers.plant.tables.feeder_columns import SOURCE_VOLTAGE

Complex = NDArray[np.complex128]


class DssElements:
    """Collects the linear elements (`rows`), switches, source (at most one) and buses of a solved circuit.

    `wanted_switches` are lines that can be opened beside the script's own switches; `used_switches` those that were
    met.
    """

    def __init__(self, engine: DssEngine, wanted_switches: set[str], problems: list[str]) -> None:
        self._engine, self._problems = engine, problems
        self._wanted = {name.lower(): name for name in wanted_switches}
        self.rows: list[LinearElement] = []
        self.switches: list[Switch] = []
        self.source: list[Source] = []
        self.used_switches: set[str] = set()
        self._node_order = nodes_of(engine.circuit)
        self._added: dict[str, tuple[str, str]] = {}
        """Buses that are not in the script: their phases, and the bus whose voltage and place they have."""
        self._own_V_nom: dict[str, float] = {}
        """Nominal voltages (V, line-to-neutral) of those that have another one."""

    def add(self, name: str, kind: str) -> None:
        """Take an element over by its primitive admittance matrix."""
        element = self._active(name)
        if kind == "line" and self._is_switch(name, element):
            self._add_switch(name)
            return
        nodes, Y = self._nodes(element), matrix(element.Yprim)
        self._append(name, nodes, Y)

    def add_source(self, name: str) -> None:
        """Take the substation over: a stiff voltage behind the source's short-circuit impedance."""
        vsource = self._engine.circuit.Vsources
        vsource.Name = name.partition(".")[2]
        element = self._active(name)
        nodes = self._nodes(element)
        if self.source:
            self._problems.append(
                f'{name}: a second source; leave it out (leave_out=["{name}"]), or put an inverter there'
            )
            return
        bus = str(element.BusNames[0]).partition(".")[0].lower()
        if vsource.Phases != 3 or sorted(nodes[:3]) != [(bus, p) for p in "ABC"] or any(node[1] for node in nodes[3:]):
            self._problems.append(f"{name}: a source has three phases between nodes 1, 2, 3 of its bus and ground")
            return
        frequency = float(self._engine.circuit.Solution.Frequency)
        if vsource.Frequency != frequency:
            self._problems.append(
                f"{name}: is of {vsource.Frequency:g} Hz, and the circuit is solved at {frequency:g} Hz, so that the "
                f"engine has 0 V; write Set DefaultBaseFrequency={frequency:g} before New Circuit"
            )
        E = 1e3 * vsource.pu * vsource.BasekV / sqrt(3.0)
        if not E > 0.0:
            self._problems.append(
                f"{name}: pu and basekv must be above 0, got {vsource.pu:g} and {vsource.BasekV:g} kV"
            )
            return
        Y = matrix(element.Yprim)[:3, :3]
        stiff = self._add_bus(bus_behind(bus, name.partition(".")[2]), bus, "ABC")
        inner = [(stiff, letter) for letter in "ABC"]
        # conductor k leads to node nodes[k], and has the angle of the k-th phase
        self._append(name, [*inner, *nodes[:3]], np.block([[Y, -Y], [-Y, Y]]))
        V_nom = self._V_nom(bus)
        if SOURCE_VOLTAGE.objection(E / V_nom):  # the voltage base of the bus is not meant for it
            V_nom = self._own_V_nom[stiff] = E
        self.source.append(Source(bus=stiff, V_pu=E / V_nom, angle=radians(vsource.AngleDeg)))

    @property
    def added(self) -> dict[str, str]:
        """Buses that are not in the script, and the bus before each."""
        return {name: like for name, (like, _) in self._added.items()}

    def buses(self, parts: list[LoadPart]) -> tuple[Bus, ...]:
        """Return the buses that anything is connected to, in the script's order, with their nodes, voltages, places."""
        used: dict[str, set[str]] = {}
        for row in self.rows:
            for bus, letter in row.nodes:
                used.setdefault(bus, set()).add(letter)
        for part in parts:
            used.setdefault(part.bus, set()).update(letter for letter in part.ends if letter)
        for switch in self.switches:
            for bus in (switch.from_bus, switch.to_bus):
                used.setdefault(bus, set()).update(switch.phases)
        found: list[Bus] = []
        beside: dict[str, list[str]] = {}
        for name, (like, _) in self._added.items():
            beside.setdefault(like, []).append(name)
        names = [str(name).lower() for name in self._engine.circuit.AllBusNames]
        for name in names:
            for each in (name, *beside.get(name, ())):
                if each not in used:
                    continue
                letters = used[each] | set(self._added[each][1] if each in self._added else "")
                x, y = self._place(name)
                found.append(
                    Bus(
                        name=each,
                        phases="".join(letter for letter in NODES if letter in letters),
                        V_nom=self._own_V_nom.get(each) or self._V_nom(name),
                        x=x,
                        y=y,
                    )
                )
        return tuple(found)

    def _is_switch(self, name: str, element: Any) -> bool:
        line = self._engine.circuit.Lines
        line.Name = name.partition(".")[2]
        if name in self._wanted:
            self.used_switches.add(self._wanted[name])
            return True
        return bool(line.IsSwitch or element.HasSwitchControl or _is_open(element))

    def _add_switch(self, name: str) -> None:
        """Put an ideal switch before a line: open, it leaves the line to hang at its other end."""
        element = self._active(name)
        is_open = _is_open(element)
        if is_open:
            for terminal in (1, 2):
                element.Close(terminal, 0)
            self._engine.execute("solve")
            element = self._active(name)
        nodes, Y = self._nodes(element), matrix(element.Yprim)
        half = len(nodes) // 2
        (bus,) = {bus for bus, letter in nodes[:half] if letter}
        letters = "".join(letter for letter in NODES if (bus, letter) in nodes[:half])
        short = name.partition(".")[2]
        behind = self._add_bus(bus_behind(bus, short), bus, letters)
        moved = [(behind if letter else at, letter) for at, letter in nodes[:half]]
        self._append(name, [*moved, *nodes[half:]], Y)
        self.switches.append(
            Switch(name=f"{bus}-{behind}", alias=short, from_bus=bus, to_bus=behind, phases=letters, closed=not is_open)
        )
        if is_open:
            self._active(name).Open(1, 0)
            self._engine.execute("solve")

    def _active(self, name: str) -> Any:
        self._engine.circuit.SetActiveElement(name)
        return self._engine.circuit.ActiveCktElement

    def _append(self, name: str, nodes: list[Node], Y: Complex) -> None:
        """Keep an element between the nodes that are not ground; nodes that stand twice are one."""
        if Y.shape[0] != len(nodes) or not np.isfinite(Y).all():
            self._problems.append(f"{name}: the engine gives no admittance matrix for it; leave it out or change it")
            return
        distinct = list(dict.fromkeys(node for node in nodes if node[1]))
        if not distinct:
            return  # all of it is grounded
        place = np.array([[node == each for each in distinct] for node in nodes], float).reshape(len(nodes), -1)
        own = place.T @ Y @ place
        rows = tuple(tuple(complex(value) for value in row) for row in own)
        self.rows.append(LinearElement(name=name, nodes=tuple(distinct), Y=rows))

    def _nodes(self, element: Any) -> list[Node]:
        """Nodes of an element in the order of its matrix; ground is a bus and no letter.

        They need not be at the bus of their terminal: the series winding of an autotransformer ends at another bus.
        """
        per = element.NumConductors
        buses = [str(name).partition(".")[0].lower() for name in element.BusNames]
        nodes = []
        for k, reference in enumerate(element.NodeRef):
            nodes.append(self._node_order[reference - 1] if reference > 0 else (buses[k // per], ""))
        return nodes

    def _add_bus(self, name: str, like: str, letters: str) -> str:
        self._added[name] = like, letters
        return name

    def _V_nom(self, bus: str) -> float:
        """Nominal voltage of a bus (V, line-to-neutral): its base in the script, or what it has."""
        self._engine.circuit.SetActiveBus(bus)
        active = self._engine.circuit.ActiveBus
        if active.kVBase > 0.0:
            return float(active.kVBase) * 1e3
        magnitudes = np.abs(complex_of(active.Voltages))
        V = float(magnitudes.max(initial=0.0))
        return V if V > 1.0 else 1.0

    def _place(self, bus: str) -> tuple[float, float]:
        self._engine.circuit.SetActiveBus(bus)
        active = self._engine.circuit.ActiveBus
        return (float(active.x), float(active.y)) if active.Coorddefined else (0.0, 0.0)


def numbered_nodes(circuit: Any) -> list[tuple[str, int]]:
    """Return bus and number of every node, in the order of the engine's matrix."""
    return [(bus, int(number)) for bus, _, number in (str(name).lower().rpartition(".") for name in circuit.YNodeOrder)]


def nodes_of(circuit: Any) -> list[Node]:
    """Return every node as ours, in the order of the engine's matrix."""
    return [(bus, letter_of(number)) for bus, number in numbered_nodes(circuit)]


def letter_of(node: int) -> str:
    """Return our letter of a bus's node of this number; ground, number 0, has none."""
    return NODES[node - 1] if node > 0 else ""


def _is_open(element: Any) -> bool:
    """Whether a line is open at one of its ends, in all phases."""
    phases = range(1, element.NumPhases + 1)
    return any(all(element.IsOpen(terminal, phase) for phase in phases) for terminal in (1, 2))


def complex_of(values: Any) -> Complex:
    """Return an array of the engine as complex numbers; some versions give pairs of real ones."""
    array = np.asarray(values)
    return array.astype(complex) if np.iscomplexobj(array) else array.astype(float).view(complex)


def matrix(values: Any) -> Complex:
    """Return a square matrix that the engine gives column by column."""
    flat = complex_of(values)
    n = round(sqrt(flat.size))
    return flat.reshape(n, n, order="F") if n * n == flat.size else np.zeros((0, 0), complex)
