"""Read a feeder that is written for OpenDSS.

The engine parses the script and solves it once, so that its regulators and capacitor controls stand where they would.
Then every linear element comes over by its primitive admittance matrix, which holds lines of any geometry and
transformers of any connection; loads come over by the law of their `model`.
"""

from __future__ import annotations

import contextlib
import fnmatch
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from plant.equipment import NODES, Feeder, Source
from plant.opendss.dss_connections import report_unconnected, report_undetermined
from plant.opendss.dss_elements import DssElements
from plant.opendss.dss_engine import DssEngine
from plant.opendss.dss_loads import read_loads
from plant.tables.read import FeederError

CONTROLS = frozenset({"regcontrol", "capcontrol"})
"""Controls that have acted when the feeder is read; afterwards what they control stays."""

WATCHING = frozenset({"energymeter", "monitor", "sensor"})
"""What measures and has no part in the network."""

PROTECTION = frozenset({"fuse", "recloser", "relay", "swtcontrol"})
"""What operates lines by itself; the lines come over, what opens them does not."""

LINEAR = frozenset({"line", "transformer", "autotrans", "reactor", "capacitor", "fault", "gictransformer"})
"""Classes that a primitive admittance matrix describes."""

GENERATION = frozenset({"generator", "pvsystem", "storage", "windgen", "indmach012", "isource"})
"""Classes whose place an inverter of ours can take."""


def read_opendss(
    path: str | Path, f_nom: float | None = None, *, leave_out: Sequence[str] = (), switches: Sequence[str] = ()
) -> Feeder:
    """Read a feeder from a script of OpenDSS.

    Parameters
    ----------
    path : str or Path
        The script, often Master.dss.
    f_nom : float, optional
        Nominal frequency (Hz); the script's if left out.
    leave_out : sequence of str, optional
        Elements to do without, as `Class.name`, with `*` for any: "PVSystem.*".
    switches : sequence of str, optional
        Lines that can be opened, beside those that the script calls switches.

    Returns
    -------
    Feeder
        Its tables; `notes` tell what was done instead of what the script says.

    Raises
    ------
    FeederError
        With everything that the engine refuses and everything that we cannot represent.
    """
    path = Path(path).absolute()
    # the engine goes back to the folder in which it was loaded, whatever the present one is
    with TemporaryDirectory(prefix="gridpeers-") as scratch, contextlib.chdir(Path.cwd()):
        return _read(path, Path(scratch), f_nom, leave_out, switches)


def _read(path: Path, scratch: Path, f_nom: float | None, leave_out: Sequence[str], switches: Sequence[str]) -> Feeder:
    engine = DssEngine()
    problems = engine.read(path, scratch)
    if problems:
        raise FeederError(path.name, tuple(problems))
    circuit = engine.circuit
    if problems := _too_many_nodes(circuit):
        raise FeederError(path.name, tuple(problems))
    notes = engine.notes
    problems = []
    left_out = _left_out(circuit, leave_out, problems)
    own = f_nom if f_nom is not None else float(circuit.Solution.Frequency)
    if f_nom is not None and f_nom != circuit.Solution.Frequency:
        problems.append(
            f"f_nom: the script's circuit is solved at {circuit.Solution.Frequency:g} Hz, got {f_nom:g}; its "
            f'reactances hold there alone; write "set frequency={f_nom:g}" in the script, or leave f_nom out'
        )
    elements = DssElements(engine, set(switches), problems, notes)
    for name, kind in _elements(circuit):
        if name in left_out:
            continue
        if kind in LINEAR:
            elements.add(name, kind)
        elif kind == "vsource":
            elements.add_source(name)
        elif kind in GENERATION:
            problems.append(
                f'{name}: class {kind} is not taken over; leave it out (leave_out=["{name}"]) or put an inverter there'
            )
        elif kind in CONTROLS | WATCHING | {"load"}:
            continue
        elif kind in PROTECTION:
            notes.append(f"{name}: what it controls stays as it is")
        else:
            problems.append(f'{name}: elements of class {kind} are not supported; leave it out (leave_out=["{name}"])')
    load_parts = read_loads(engine, left_out, problems)
    for name in set(switches) - elements.used_switches:
        problems.append(f'switches: there is no line "{name}"')
    if not any(kind == "vsource" and name not in left_out for name, kind in _elements(circuit)):
        problems.append("no Vsource: a circuit has one, its substation")
    elif elements.source:
        report_unconnected(elements.rows, elements.switches, load_parts, elements.source[0], problems)
    if problems:
        raise FeederError(path.name, tuple(problems))
    source: Source = elements.source[0]
    feeder = Feeder(
        name=str(circuit.Name),
        load_set="main",
        buses=elements.buses(load_parts),
        lines=(),
        line_configs=(),
        switches=tuple(elements.switches),
        loads=(),
        capacitors=(),
        regulators=(),
        transformers=(),
        inverters=(),
        source=source,
        f_nom=own,
        elements=tuple(elements.rows),
        load_parts=tuple(load_parts),
        notes=tuple(notes),
    )
    report_undetermined(feeder, problems)
    if problems:
        raise FeederError(path.name, tuple(problems))
    return feeder


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
    nodes = [str(name).partition(".") for name in circuit.YNodeOrder]
    buses = dict.fromkeys(bus.lower() for bus, _, number in nodes if int(number) > len(NODES))
    return [f"bus {bus}: nodes above {len(NODES)} are not supported; give its nodes lower numbers" for bus in buses]


def _left_out(circuit: Any, patterns: Sequence[str], problems: list[str]) -> set[str]:
    names = [name for name, _ in _elements(circuit)]
    found: set[str] = set()
    for pattern in patterns:
        matching = fnmatch.filter(names, pattern.lower())
        if not matching:
            problems.append(f'leave_out: "{pattern}" matches no element; write Class.name, e.g. "PVSystem.pv1"')
        found.update(matching)
    return found
