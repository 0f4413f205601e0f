"""A circuit as the OpenDSS engine has it: a feeder by its elements and loads, not yet checked as a network."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gridpeers.bridges.import_checks import left_out_by, refuse_if, report_powers
from gridpeers.bridges.opendss.dss_elements import DssElements, complex_of, nodes_of, numbered_nodes
from gridpeers.bridges.opendss.dss_engine import METERS, DssEngine, unusual_voltages
from gridpeers.bridges.opendss.dss_loads import GENERATION, read_generation, read_loads
from gridpeers.plant.equipment import NODES, Feeder
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.wire.wording import suggestion

CONTROLS = frozenset({"regcontrol", "capcontrol"})
"""Controls that have acted when the feeder is read; afterwards what they control stays."""

PROTECTION = frozenset({"fuse", "recloser", "relay", "swtcontrol"})
"""Classes that open lines by themselves: the lines are imported and stay as they are."""

LINEAR = frozenset({"line", "transformer", "autotrans", "reactor", "capacitor", "fault", "gictransformer"})
"""Classes that a primitive admittance matrix describes."""

MACHINES = frozenset({"windgen", "indmach012", "isource"})
"""Classes whose place an inverter of ours can take."""

INVERTER_CONTROLS = frozenset({"invcontrol", "expcontrol"})
"""Controls of inverters, which have acted likewise."""


class ImportRequest(NamedTuple):
    """What to read, and how; `gridpeers.feeder.Feeder.from_opendss` explains it."""

    path: Path
    f_nom: float | None
    leave_out: Sequence[str]
    switches: Sequence[str]


class DssCircuit(NamedTuple):
    """What the engine made of a script."""

    feeder: Feeder
    problems: list[str]
    """What cannot be represented."""
    left_out: bool
    """Whether something was left out, so that the engine's voltages are those of another circuit."""
    V: dict[tuple[str, str], complex]
    """The engine's voltages (V) by bus and letter of the node."""
    added: dict[str, str]
    """Buses that are not in the script, and the bus before each."""


def read_circuit(request: ImportRequest, scratch: Path, tell: Callable[[str], None]) -> DssCircuit:
    """Return the circuit of a script; FeederError has all that the engine refuses.

    `scratch` takes what the engine writes by itself, `tell` what it is about to do, with file and line.
    """
    path, f_nom, leave_out, switches = request
    engine = DssEngine(tell)
    refuse_if(path, engine.read(path, scratch), engine.places)
    circuit = engine.circuit
    refuse_if(path, _too_many_nodes(circuit), engine.places)
    notes, problems = engine.notes, list[str]()
    everything = _elements(circuit)
    left_out = left_out_by([name for name, _ in everything], leave_out, problems, "PVSystem.pv1")
    frequency = float(circuit.Solution.Frequency)
    if f_nom is not None and f_nom != frequency:
        problems.append(
            f"f_nom: the script's circuit is solved at {frequency:g} Hz, got {f_nom:g}; its "
            f'reactances hold there alone; write "set frequency={f_nom:g}" in the script, or leave f_nom out'
        )
    elements = DssElements(engine, set(switches), problems)
    generated: list[LoadPart] = []
    there = [(name, kind) for name, kind in everything if name not in left_out]
    for name, kind in there:
        tell(f"{path.name}: {name}")
        if kind in LINEAR:
            elements.add(name, kind)
        elif kind == "vsource":
            elements.add_source(name)
        elif kind in GENERATION:
            generated += read_generation(engine, name, notes, problems)
        elif kind in INVERTER_CONTROLS:
            notes.append(f"{name}: what it controls stays as in the snapshot")
        elif kind in MACHINES:
            problems.append(
                f'{name}: class {kind} is not taken over; leave it out (leave_out=["{name}"]) or put an inverter there'
            )
        elif kind in PROTECTION:
            notes.append(f"{name}: what it controls stays as it is")
        elif kind not in CONTROLS | METERS | {"load"}:
            problems.append(f'{name}: elements of class {kind} are not supported; leave it out (leave_out=["{name}"])')
    load_parts = [*read_loads(engine, left_out, notes, problems), *generated]
    lines = [name for name, kind in there if kind == "line"]
    for name in sorted(set(switches) - elements.used_switches):
        problems.append(f'switches: there is no line "{name}"; {suggestion(name.lower(), lines, "lines")}')
    if all(kind != "vsource" for _, kind in there):
        problems.append("no Vsource: a circuit has one, its substation")
    if not elements.source:
        refuse_if(path, problems, engine.places)
    report_powers(load_parts, problems)
    V = dict(zip(nodes_of(circuit), complex_of(circuit.YNodeVarray).tolist(), strict=True))
    notes += unusual_voltages(circuit, load_parts, V)
    feeder = Feeder(
        name=str(circuit.Name),
        load_set="main",
        buses=elements.buses(load_parts),
        switches=tuple(elements.switches),
        source=elements.source[0],
        f_nom=frequency,
        elements=tuple(elements.rows),
        load_parts=tuple(load_parts),
        notes=tuple(notes),
        places=engine.places,
    )
    return DssCircuit(feeder, problems, bool(left_out), V, elements.added)


def _elements(circuit: Any) -> list[tuple[str, str]]:
    """Names and classes of all elements that are enabled, in the script's order."""
    found = []
    for i in range(circuit.NumCktElements):
        element = circuit.CktElements(i)
        if element.Enabled:
            name = str(element.Name).lower()
            found.append((name, name.partition(".")[0]))
    return found


def _too_many_nodes(circuit: Any) -> list[str]:
    """Return a problem for each bus with more nodes than we have letters."""
    buses = dict.fromkeys(bus for bus, number in numbered_nodes(circuit) if number > len(NODES))
    return [f"bus {bus}: nodes above {len(NODES)} are not supported; give its nodes lower numbers" for bus in buses]
