"""A circuit as the OpenDSS engine has it: primitive admittances between nodes of ours, switches, source and loads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gridpeers.bridges.import_checks import bus_rows, element_of, left_out_by, refuse_if, report_powers
from gridpeers.bridges.opendss.dss_engine import METERS, DssEngine, bus_of, complexes, unusual_voltages
from gridpeers.bridges.opendss.dss_loads import GENERATION, letter_of, read_generation, read_loads
from gridpeers.plant.equipment import NODES, Feeder, Source, Switch
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart, bus_behind
from gridpeers.plant.tables.feeder_columns import SOURCE_VOLTAGE
from gridpeers.wire.wording import suggestion

LINEAR = frozenset({"line", "transformer", "autotrans", "reactor", "capacitor", "fault", "gictransformer"})
"""Classes that a primitive admittance matrix describes."""

NOTED = {  # classes that change others by themselves, and what becomes of these
    **dict.fromkeys(("invcontrol", "expcontrol"), "what it controls stays as in the snapshot"),
    **dict.fromkeys(("fuse", "recloser", "relay", "swtcontrol"), "what it controls stays as it is"),
}

SILENT = METERS | {"regcontrol", "capcontrol", "load"}
"""Classes without anything to do or to say: controls that have acted in the snapshot, and loads, which come apart."""

REFUSED = dict.fromkeys(("windgen", "indmach012", "isource"), "class {} is not taken over; {} or put an inverter there")
"""Classes whose place an inverter of ours can take."""


class ImportRequest(NamedTuple):
    """What to read, and how; `gridpeers.feeder.Feeder.from_opendss` explains it."""

    path: str
    f_nom: float | None
    leave_out: Sequence[str]
    switches: Sequence[str]


class DssCircuit(NamedTuple):
    """A circuit that the engine has read: the feeder, not yet checked as a network, and the engine's voltages."""

    feeder: Feeder
    problems: list[str]  # what cannot be represented
    left_out: bool  # whether something was left out, so that the engine's voltages are those of another circuit
    V: dict[Node, complex]  # the engine's voltages (V)
    added: dict[str, str]  # buses that are not in the script, and the bus before each


def read_circuit(request: ImportRequest, tell: Callable[[str], None]) -> DssCircuit:
    """Return the circuit of a script; FeederError has all that the engine refuses.

    `tell` takes what the engine is about to do, with file and line. What it writes by itself goes where this process
    stands.
    """
    path, f_nom = Path(request.path), request.f_nom
    engine = DssEngine(tell)
    refuse_if(path, engine.read(path, Path.cwd()), engine.places)
    circuit = engine.circuit
    names = (str(name).lower().rpartition(".") for name in circuit.YNodeOrder)
    nodes = [(bus, int(number)) for bus, _, number in names]
    high = dict.fromkeys(bus for bus, number in nodes if number > len(NODES))
    crowded = [f"bus {bus}: nodes above {len(NODES)} are not supported; give its nodes lower numbers" for bus in high]
    refuse_if(path, crowded, engine.places)
    V = dict(zip([(bus, letter_of(n)) for bus, n in nodes], complexes(circuit.YNodeVarray).tolist(), strict=True))
    notes, problems = engine.notes, list[str]()
    frequency = float(circuit.Solution.Frequency)
    if f_nom is not None and f_nom != frequency:
        problems.append(
            f"f_nom: the script's circuit is solved at {frequency:g} Hz, got {f_nom:g}; its "
            f'reactances hold there alone; write "set frequency={f_nom:g}" in the script, or leave f_nom out'
        )
    elements = (circuit.CktElements(i) for i in range(circuit.NumCktElements))  # one object, which moves on
    everything = [str(element.Name).lower() for element in elements if element.Enabled]
    left_out = left_out_by(everything, request.leave_out, problems, "PVSystem.pv1")
    there = [name for name in everything if name not in left_out]
    taken = DssElements(engine, request.switches, list(V), problems)
    generated: list[LoadPart] = []
    for name in there:
        tell(f"{path.name}: {name}")
        kind = name.partition(".")[0]
        hint = f'leave it out (leave_out=["{name}"])'
        if kind in LINEAR:
            taken.add(name)
        elif kind == "vsource":
            taken.add_source(name)
        elif kind in GENERATION:
            generated += read_generation(engine, name, notes, problems)
        elif kind in NOTED:
            notes.append(f"{name}: {NOTED[kind]}")
        elif kind not in SILENT:
            refusal = REFUSED.get(kind, "elements of class {} are not supported; {}")
            problems.append(f"{name}: {refusal.format(kind, hint)}")
    load_parts = [*read_loads(engine, left_out, notes, problems), *generated]
    lines = [name for name in there if name.startswith("line.")]
    for name in request.switches:
        if name.lower() not in lines:
            problems.append(f'switches: there is no line "{name}"; {suggestion(name.lower(), lines, "lines")}')
    if not any(name.startswith("vsource.") for name in there):
        problems.append("no Vsource: a circuit has one, its substation")
    if taken.source is None:
        refuse_if(path, problems, engine.places)
    report_powers(load_parts, problems)
    notes += unusual_voltages(circuit, load_parts, V)
    feeder = Feeder(
        name=str(circuit.Name),
        load_set="main",
        buses=bus_rows(taken.places(), taken.added, taken.rows, taken.switches, load_parts, taken.source),
        switches=tuple(taken.switches),
        source=taken.source,
        f_nom=frequency,
        elements=tuple(taken.rows),
        load_parts=tuple(load_parts),
        notes=tuple(notes),
        places=engine.places,
    )
    return DssCircuit(feeder, problems, bool(left_out), V, taken.added)


class DssElements:
    """Collects the linear elements (`rows`), switches, source and `added` buses of a solved circuit.

    Lines that are named in `switches` can be opened, beside the script's own switches.
    """

    def __init__(self, engine: DssEngine, switches: Sequence[str], order: list[Node], problems: list[str]) -> None:
        self._engine, self._order, self._problems = engine, order, problems
        self._wanted = {name.lower() for name in switches}
        self.rows: list[LinearElement] = []
        self.switches: list[Switch] = []
        self.source: Source | None = None
        self.added: dict[str, str] = {}
        """Buses that are not in the script, and the bus whose voltage and place each has."""
        self._source_place: dict[str, tuple[float, float, float]] = {}

    def add(self, name: str) -> None:
        """Take an element over by its primitive admittance matrix; before a line that switches stands an ideal switch.

        Open, the switch leaves the line to hang at its other end.
        """
        element = self._active(name)
        short = name.removeprefix("line.")
        is_switch = is_open = False
        if short != name:
            line = self._engine.circuit.Lines
            line.Name = short
            is_open = any(
                all(element.IsOpen(terminal, phase) for phase in range(1, element.NumPhases + 1)) for terminal in (1, 2)
            )
            is_switch = bool(name in self._wanted or line.IsSwitch or element.HasSwitchControl or is_open)
        if is_open:
            for terminal in (1, 2):
                element.Close(terminal, 0)
            self._engine.execute("solve")
            element = self._active(name)
        nodes, Y = self._nodes(element), matrix(element.Yprim)
        if is_switch:
            half = len(nodes) // 2
            (bus,) = {bus for bus, letter in nodes[:half] if letter}
            behind = bus_behind(bus, short)
            letters = "".join(letter for letter in NODES if (bus, letter) in nodes[:half])
            self.added[behind] = bus
            nodes[:half] = [(behind if letter else at, letter) for at, letter in nodes[:half]]
            self.switches.append(
                Switch(
                    name=f"{bus}-{behind}", alias=short, from_bus=bus, to_bus=behind, phases=letters, closed=not is_open
                )
            )
        self._append(name, nodes, Y)
        if is_open:
            self._active(name).Open(1, 0)
            self._engine.execute("solve")

    def add_source(self, name: str) -> None:
        vsource, short = self._engine.circuit.Vsources, name.partition(".")[2]
        vsource.Name = short
        element = self._active(name)
        nodes = self._nodes(element)
        bus, frequency = bus_of(element.BusNames[0]), float(self._engine.circuit.Solution.Frequency)
        if self.source is not None:
            problem = f'a second source; leave it out (leave_out=["{name}"]), or put an inverter there'
        elif (
            vsource.Phases != 3 or sorted(nodes[:3]) != [(bus, p) for p in "ABC"] or any(node[1] for node in nodes[3:])
        ):
            problem = "a source has three phases between nodes 1, 2, 3 of its bus and ground"
        elif not (E := 1e3 * vsource.pu * vsource.BasekV / sqrt(3.0)) > 0.0:
            problem = f"pu and basekv must be above 0, got {vsource.pu:g} and {vsource.BasekV:g} kV"
        else:
            problem = ""
            Y = matrix(element.Yprim)[:3, :3]
            stiff = bus_behind(bus, short)
            self.added[stiff] = bus
            # conductor k leads to node nodes[k], and has the angle of the k-th phase
            self._append(name, [*((stiff, letter) for letter in "ABC"), *nodes[:3]], np.block([[Y, -Y], [-Y, Y]]))
            V_nom, x, y = self._place(bus)
            if SOURCE_VOLTAGE.objection(E / V_nom):  # the voltage base of the bus is not meant for it
                V_nom = E
            self._source_place = {stiff: (V_nom, x, y)}
            self.source = Source(bus=stiff, V_pu=E / V_nom, angle=radians(vsource.AngleDeg))
            if vsource.Frequency != frequency:
                problem = (
                    f"is of {vsource.Frequency:g} Hz, and the circuit is solved at {frequency:g} Hz, so that the "
                    f"engine has 0 V; write Set DefaultBaseFrequency={frequency:g} before New Circuit"
                )
        if problem:
            self._problems.append(f"{name}: {problem}")

    def places(self) -> dict[str, tuple[float, float, float]]:
        """Return the nominal voltage (V, line-to-neutral) and coordinates of each bus, in the script's order."""
        names = [str(name).lower() for name in self._engine.circuit.AllBusNames]
        return {name: self._place(name) for name in names} | self._source_place

    def _active(self, name: str) -> Any:
        self._engine.circuit.SetActiveElement(name)
        return self._engine.circuit.ActiveCktElement

    def _append(self, name: str, nodes: list[Node], Y: Any) -> None:
        """Keep an element between the nodes that are not ground; nodes that stand twice are one."""
        if Y.shape[0] != len(nodes) or not np.isfinite(Y).all():
            self._problems.append(f"{name}: the engine gives no admittance matrix for it; leave it out or change it")
            return
        distinct = list(dict.fromkeys(node for node in nodes if node[1]))
        if distinct:  # else all of it is grounded
            place = np.array([[node == each for each in distinct] for node in nodes], float)
            self.rows.append(element_of(name, distinct, place.T @ Y @ place))

    def _nodes(self, element: Any) -> list[Node]:
        """Return the nodes of an element in the order of its matrix; ground is a bus and no letter.

        They need not be at the bus of their terminal: the series winding of an autotransformer ends at another bus.
        """
        buses, per = [bus_of(name) for name in element.BusNames], element.NumConductors
        return [self._order[ref - 1] if ref else (buses[k // per], "") for k, ref in enumerate(element.NodeRef)]

    def _place(self, bus: str) -> tuple[float, float, float]:
        """Return the nominal voltage of a bus (V, line-to-neutral), its base or what it has, and its coordinates."""
        self._engine.circuit.SetActiveBus(bus)
        active = self._engine.circuit.ActiveBus
        x, y = (float(active.x), float(active.y)) if active.Coorddefined else (0.0, 0.0)
        if active.kVBase > 0.0:
            return float(active.kVBase) * 1e3, x, y
        return max(1.0, float(np.abs(complexes(active.Voltages)).max(initial=0.0))), x, y


def matrix(values: Any) -> np.ndarray[Any, np.dtype[np.complex128]]:
    """Return a square matrix that the engine gives column by column."""
    flat = complexes(values)
    n = round(sqrt(flat.size))
    return flat.reshape(n, n, order="F") if n * n == flat.size else np.zeros((0, 0), complex)
