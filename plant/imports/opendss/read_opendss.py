"""Read a feeder that is written for OpenDSS.

The engine parses the script and solves it once, so that its regulators and capacitor controls stand where they would.
Then every linear element comes over by its primitive admittance matrix, which holds lines of any geometry and
transformers of any connection; loads come over by the law of their `model`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from plant.equipment import NODES, Feeder
from plant.equipment.imported_equipment import LoadPart
from plant.imports.import_checks import SHOWN, left_out_by, number_of, refuse_if, refuse_unsolvable, without_unfed
from plant.imports.import_comparison import MATCH, difference, loads_without_ground
from plant.imports.opendss.dss_elements import DssElements, complex_of, nodes_of, numbered_nodes
from plant.imports.opendss.dss_engine import DssEngine
from plant.imports.opendss.dss_generation import GENERATION, read_generation
from plant.imports.opendss.dss_loads import read_loads
from plant.imports.opendss.dss_script import METERS
from wire.schema.suggestion import suggestion

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

UNGROUNDED = "ground a winding, or leave ppm_antifloat as it is"
"""Remedy where nothing determines a voltage to ground."""


def read_opendss(
    path: str | Path, f_nom: float | None = None, *, leave_out: Sequence[str] = (), switches: Sequence[str] = ()
) -> Feeder:
    """Return the feeder of a script for OpenDSS; `gridpeers.feeder.Feeder.from_opendss` explains the parameters.

    Its `notes` list what was done instead of what the script says.

    Raises
    ------
    FeederError
        With everything that the engine refuses and everything that cannot be represented.
    """
    path = Path(path).absolute()
    # the engine goes back to the folder in which it was loaded, whatever the present one is
    with TemporaryDirectory(prefix="gridpeers-") as scratch, contextlib.chdir(Path.cwd()):
        return _read(path, Path(scratch), f_nom, leave_out, switches)


def _read(path: Path, scratch: Path, f_nom: float | None, leave_out: Sequence[str], switches: Sequence[str]) -> Feeder:
    engine = DssEngine()
    refuse_if(path, engine.read(path, scratch))
    circuit = engine.circuit
    refuse_if(path, _too_many_nodes(circuit))
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
        refuse_if(path, problems)
    feeder = Feeder(
        name=str(circuit.Name),
        load_set="main",
        buses=elements.buses(load_parts),
        switches=tuple(elements.switches),
        source=elements.source[0],
        f_nom=frequency,
        elements=tuple(elements.rows),
        load_parts=tuple(load_parts),
    )
    if not problems:
        feeder = without_unfed(feeder, notes)
    feeder = msgspec.structs.replace(feeder, notes=tuple(notes))
    refuse_unsolvable(path, feeder, problems, UNGROUNDED)
    if left_out:
        return feeder
    return _compared(path, feeder, circuit)


def _compared(path: Path, feeder: Feeder, circuit: Any) -> Feeder:
    """Return the feeder with a note if our power flow has not the engine's voltages; refuse it if it has none."""
    theirs = dict(zip(nodes_of(circuit), complex_of(circuit.YNodeVarray).tolist(), strict=True))
    solved = True
    try:
        worst, (bus, letter), two_solutions = difference(feeder, theirs)
        if worst <= MATCH:
            return feeder
        node = f"{bus}.{number_of(letter)}"
        told = f"{path.name}: our power flow differs from the engine's by {worst:.2g} pu, most at {node}"
        if two_solutions:
            told += "; both are solutions, as loads allow whose law jumps at Vminpu or Vmaxpu (models 3 and 4)"
    except ArithmeticError as error:
        solved, told = False, f"{path.name}: the engine solves it, our {error}"
    alone = loads_without_ground(feeder)
    if alone:
        more = f" and {len(alone) - SHOWN} more" if len(alone) > SHOWN else ""
        told = (
            f"{', '.join(alone[:SHOWN])}{more}: constant power to ground behind a delta winding, where nothing else is "
            "grounded: the voltage to ground has no single solution; make it conn=delta or model=2, or ground a winding"
        )
    if alone or not solved:
        refuse_if(path, [told])
    return msgspec.structs.replace(feeder, notes=(*feeder.notes, told))


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
