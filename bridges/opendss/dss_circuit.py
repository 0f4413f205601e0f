"""A circuit as the OpenDSS engine has it: primitive admittances between nodes of ours, switches, source and loads."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.bridges.engine_process import Tell, serve
from gridpeers.bridges.feeder_import import FeederImport
from gridpeers.bridges.opendss.dss_engine import METERS, DssEngine, bus_of, complexes, note_unusual_voltages
from gridpeers.bridges.opendss.dss_loads import GENERATION, letter_of, read_generation, read_loads
from gridpeers.plant.equipment import NODES, Source
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.tables.feeder_columns import SOURCE_VOLTAGE
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import damaged, suggestion

LINEAR = frozenset({"line", "transformer", "autotrans", "reactor", "capacitor", "fault", "gictransformer"})
"""Classes that a primitive admittance matrix describes."""

NOTED = {  # classes that change others by themselves, and what becomes of these
    **dict.fromkeys(("invcontrol", "expcontrol"), "its elements stay as in the snapshot"),
    **dict.fromkeys(("fuse", "recloser", "relay", "swtcontrol"), "the element that it controls stays as it is"),
}

SILENT = METERS | {"regcontrol", "capcontrol", "load"}
"""Classes without anything to do or to say: controls that have acted in the snapshot, and loads, which come apart."""


def main() -> None:
    serve("the OpenDSS engine", read_circuit)


def read_circuit(request: dict[str, Any], tell: Tell) -> FeederImport:
    """Return the circuit of a script; FeederError has all that the engine refuses.

    `request` has the arguments of `read_opendss`. What the engine writes by itself goes where this process stands.
    """
    path, wanted = Path(request["path"]), request["switches"]
    try:
        from dss import DSS  # noqa: F401
    except Exception as error:  # a damaged package may raise anything
        text = damaged("dss", f"{type(error).__name__}: {error}", "the import of .dss files")
        raise FeederError(path.name, (text,)) from None
    found = FeederImport(path.name)
    engine = DssEngine(found, tell)
    engine.read(path, Path.cwd())
    circuit = engine.circuit
    nodes = [str(name).lower().rpartition(".") for name in circuit.YNodeOrder]
    for bus in dict.fromkeys(bus for bus, _, number in nodes if int(number) > len(NODES)):
        found.refuse(f"bus {bus}", f"nodes above {len(NODES)} are not supported; give its nodes lower numbers")
    found.raise_problems()
    found.name, found.f_nom = str(circuit.Name), float(circuit.Solution.Frequency)
    found.expect_frequency(request["f_nom"], 'write "set frequency={:g}" in the script')
    elements = (circuit.CktElements(i) for i in range(circuit.NumCktElements))  # one object, which moves on
    everything = [str(element.Name).lower() for element in elements if element.Enabled]
    left_out = found.leave_out(everything, request["leave_out"], "PVSystem.pv1")
    there = [name for name in everything if name not in left_out]
    taken = DssElements(engine, found, wanted, [(bus, letter_of(int(number))) for bus, _, number in nodes])
    found.V = dict(zip(taken.order, complexes(circuit.YNodeVarray).tolist(), strict=True))
    generated: list[LoadPart] = []
    for name in there:
        tell(f"{path.name}: {name}")
        kind = name.partition(".")[0]
        if kind in LINEAR:
            taken.add(name)
        elif kind == "vsource":
            taken.add_source(name)
        elif kind in GENERATION:
            generated += read_generation(engine, name, taken.bus_names, found)
        elif kind in NOTED:
            found.notes.append(f"{name}: {NOTED[kind]}")
        elif kind not in SILENT:
            found.refuse_class(name)
    found.add_loads([*read_loads(engine, left_out, taken.bus_names, found), *generated])
    lines = [name for name in there if name.startswith("line.")]
    for name in wanted:
        if name.lower() not in lines:
            found.refuse("switches", f'there is no line "{name}"; {suggestion(name.lower(), lines, "lines")}')
    if not any(name.startswith("vsource.") for name in there):
        found.refuse("no Vsource", "a circuit needs one, its substation")
    note_unusual_voltages(found)
    if left_out:  # the voltages are those of another circuit
        found.V = {}
    return found


class DssElements:
    """Takes over the linear elements, switches and source of a solved circuit.

    Lines that are named in `switches` can be opened, beside the script's own switches.
    """

    def __init__(self, engine: DssEngine, found: FeederImport, switches: Sequence[str], order: Sequence[Node]) -> None:
        self._engine, self._found = engine, found
        self._wanted = {name.lower() for name in switches}
        names = [str(name).lower() for name in engine.circuit.AllBusNames]
        self.bus_names = found.name_buses(names)  # by those of the script
        self.order = [(self.bus_names[bus], letter) for bus, letter in order]  # nodes in the engine's order
        for name in names:
            found.buses[self.bus_names[name]] = self._place(name)

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
            letters = "".join(letter for letter in NODES if (bus, letter) in nodes[:half])
            behind = self._found.add_switch(bus, short, letters, closed=not is_open)
            nodes[:half] = [(behind if letter else at, letter) for at, letter in nodes[:half]]
        self._found.add_element(name, nodes, Y)
        if is_open:
            self._active(name).Open(1, 0)
            self._engine.execute("solve")

    def add_source(self, name: str) -> None:
        found, vsource, short = self._found, self._engine.circuit.Vsources, name.partition(".")[2]
        vsource.Name = short
        element = self._active(name)
        nodes = self._nodes(element)
        bus = self.bus_names[bus_of(element.BusNames[0])]
        if found.source is not None:
            problem = f"a second source; leave it out (--leave-out {name}), or add an inverter at its bus"
        elif (
            vsource.Phases != 3 or sorted(nodes[:3]) != [(bus, p) for p in "ABC"] or any(node[1] for node in nodes[3:])
        ):
            problem = "a source needs three phases between nodes 1, 2, 3 of its bus and ground"
        elif not (E := 1e3 * vsource.pu * vsource.BasekV / sqrt(3.0)) > 0.0:
            problem = f"pu and basekv must be above 0, got {vsource.pu:g} and {vsource.BasekV:g} kV"
        else:
            problem = ""
            Y = matrix(element.Yprim)[:3, :3]
            stiff = found.add_bus(bus, short)
            # conductor k leads to node nodes[k], and has the angle of the k-th phase
            ends = [*((stiff, letter) for letter in "ABC"), *nodes[:3]]
            found.add_element(name, ends, np.block([[Y, -Y], [-Y, Y]]))
            V_nom, x, y = found.buses[bus]
            if SOURCE_VOLTAGE.objection(E / V_nom):  # the voltage base of the bus is not meant for it
                V_nom = E
            found.buses[stiff] = (V_nom, x, y)
            found.source = Source(bus=stiff, V_pu=E / V_nom, angle=radians(vsource.AngleDeg))
            if vsource.Frequency != found.f_nom:
                problem = (
                    f"has {vsource.Frequency:g} Hz, but the circuit is solved at {found.f_nom:g} Hz, so the "
                    f"engine finds 0 V; write Set DefaultBaseFrequency={found.f_nom:g} before New Circuit"
                )
        if problem:
            found.refuse(name, problem)

    def _active(self, name: str) -> Any:
        self._engine.circuit.SetActiveElement(name)
        return self._engine.circuit.ActiveCktElement

    def _nodes(self, element: Any) -> list[Node]:
        """Return the nodes of an element in the order of its matrix; ground is a bus and no letter.

        They need not be at the bus of their terminal: the series winding of an autotransformer ends at another bus.
        """
        buses, per = [self.bus_names[bus_of(name)] for name in element.BusNames], element.NumConductors
        return [self.order[ref - 1] if ref else (buses[k // per], "") for k, ref in enumerate(element.NodeRef)]

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
