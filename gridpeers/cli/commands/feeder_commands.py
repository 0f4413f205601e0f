"""The commands `gridpeers feeder ...`: import a feeder, check it, solve it, draw it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gridpeers.cli.commands.feeder_glm_command import glm
from gridpeers.cli.usage import BAD_INPUT, fail, refuse
from gridpeers.wire.wording import counted

if TYPE_CHECKING:
    from gridpeers.feeder import Feeder

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Import, check, solve, draw and export feeders.")

FeederName = Annotated[
    str,
    typer.Argument(
        metavar="FEEDER", help="A feeder that comes with gridpeers, a folder of tables, or a .dss or .glm file."
    ),
]
Switches = Annotated[
    list[str] | None,
    typer.Option("--switch", metavar="LINE", help="A line to make a switch, beside the script's own; repeat it."),
]
LeaveOut = Annotated[
    list[str] | None,
    typer.Option("--leave-out", metavar="ELEMENT", help='Do without Class.name, * for any: "PVSystem.*"; repeat it.'),
]
LoadSet = Annotated[
    str | None, typer.Option("--load-set", metavar="NAME", help="Load table of a folder of tables; main if left out.")
]
SHOWN = 12
"""Notes that are shown."""


@app.command("import")
def import_(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Script for OpenDSS (.dss) or model for GridLAB-D (.glm).")
    ],
    out: Annotated[Path | None, typer.Option("--out", help="Folder for its tables; else the feeder's name.")] = None,
    switch: Switches = None,
    leave_out: LeaveOut = None,
) -> None:
    """Read a feeder that was written for OpenDSS or GridLAB-D, and write it as tables that a scenario can name.

    Exit code: 0 it was written, 2 something in it cannot be read or represented; every such element is named.

    Example:  gridpeers feeder import Master.dss --out my-feeder
    """
    from gridpeers.output_folders import FolderError, shown, whole_folder
    from gridpeers.plant.tables import feeders

    feeder = read_script(str(file), switch or [], leave_out or [])
    folder = out or Path(folder_of(feeder.name))
    try:
        with whole_folder(folder):
            save_readable(feeder, folder, file.name)
    except FolderError as error:
        fail([str(error)], BAD_INPUT)
    _describe(feeder)
    for note in feeder.notes[:SHOWN]:
        typer.echo(f"NOTE  {note}")
    if len(feeder.notes) > SHOWN:
        typer.echo(f"NOTE  and {len(feeder.notes) - SHOWN} more")
    if str(folder) in feeders():
        typer.echo(f'NOTE  in a scenario write "./{folder}": "{folder}" is the feeder that comes with gridpeers')
    typer.echo(f"Tables: {shown(folder)}")


@app.command()
def check(feeder: FeederName, load_set: LoadSet = None, switch: Switches = None, leave_out: LeaveOut = None) -> None:
    """Check a feeder; say what it has, and what opening each switch would cut off.

    Exit code: 0 it is sound, 2 it has problems; all of them are named.

    Example:  gridpeers feeder check microgrid123
    """
    from gridpeers.plant.equipment.connectivity import Connectivity
    from gridpeers.plant.equipment.neutrals import returns_in_words

    tables = _read(feeder, load_set, switch, leave_out)
    _describe(tables)
    graph, load = Connectivity(tables), tables.load_by_bus()
    for each in tables.switches:
        name = each.alias or each.name
        if not each.closed:
            typer.echo(f"switch {name}: open")
            continue
        behind = graph.cut_off(each)
        if not behind:
            typer.echo(f"switch {name}: closed; there is another way around it")
            continue
        inverters = [row.name for row in tables.inverters if row.bus in behind]
        cut = (
            f"{counted(len(behind), 'bus', 'buses')}, {sum(load.get(bus, 0.0) for bus in behind) / 1e3:.0f} kW of load"
        )
        typer.echo(f"switch {name}: closed; open, it cuts off {cut}{', ' + ', '.join(inverters) if inverters else ''}")
    for text in returns_in_words(tables):
        typer.echo(text)


@app.command()
def solve(
    feeder: FeederName,
    open_: Annotated[
        list[str] | None, typer.Option("--open", metavar="SWITCH", help="Open it first; repeat it.")
    ] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="File for all voltages.")] = None,
    load_set: LoadSet = None,
    switch: Switches = None,
    leave_out: LeaveOut = None,
) -> None:
    """Solve the power flow from the substation, without inverters; show the lowest and highest voltages.

    Exit code: 0 it is solved, 2 it cannot be.

    Example:  gridpeers feeder solve microgrid123 --open 13-152
    """
    from gridpeers.plant.equipment.imported_equipment import is_behind
    from gridpeers.scenarios.results.run_files import refusal, shown, write_whole

    try:
        table = _read(feeder, load_set, switch, leave_out).solve(open_ or ())
    except (ValueError, ArithmeticError) as error:
        fail([f"{feeder}: {error}"], BAD_INPUT)
    phases = table[table["phase"].isin(list("ABC"))]
    live = phases[phases["V"] > 0.0]
    text = f"{counted(len(live), 'node')} with voltage"
    if dead := len(phases) - len(live):
        text += f", {dead} without, as the substation does not reach {'it' if dead == 1 else 'them'}"
    if others := len(table) - len(phases):
        text += f"; {counted(others, 'node')} beside phases A, B and C (neutrals) not counted"
    typer.echo(text)
    live = live[~live["bus"].map(is_behind).astype(bool)]  # an import's own buses stand beside one that the script has
    V_pu = live["V_pu"].round(9)  # nodes with the same voltage: the first, whatever the last digits
    for what, row in (("lowest", live.loc[V_pu.idxmin()]), ("highest", live.loc[V_pu.idxmax()])):
        between = f"{row['phase']} to {row['to']}, its neutral" if row["to"] else row["phase"]
        typer.echo(f"{what:7}  {row['V_pu']:.4f} pu  bus {row['bus']}, phase {between}")
    neutrals = table.merge(live[["bus", "to"]].drop_duplicates(), left_on=["bus", "phase"], right_on=["bus", "to"])
    if len(neutrals):
        worst = neutrals.loc[neutrals["V"].idxmax()]
        typer.echo(f"neutral  {worst['V']:.2f} V to earth at most, bus {worst['bus']}, node {worst['phase']}")
    if csv is not None:
        try:
            write_whole(csv, table.to_csv(index=False))
        except OSError as error:
            fail([refusal(csv, error)], BAD_INPUT)
        typer.echo(f"Voltages: {shown(csv)}")


@app.command()
def plot(
    feeder: FeederName,
    out: Annotated[Path, typer.Option("--out", help="File of the figure: .png, .svg or .pdf.")] = Path("feeder.png"),
    voltages: Annotated[bool, typer.Option("--voltages", help="Colour by voltage instead of by microgrid.")] = False,
    load_set: LoadSet = None,
    switch: Switches = None,
    leave_out: LeaveOut = None,
) -> None:
    """Draw a feeder's one-line diagram, on its coordinates or as a tree.

    Exit code: 0 it was drawn, 2 it cannot be.

    Example:  gridpeers feeder plot microgrid123 --out map.svg
    """
    from io import BytesIO

    from gridpeers.scenarios.results.run_files import refusal, shown, write_whole

    tables = _read(feeder, load_set, switch, leave_out)
    try:
        out = out if out.suffix else out.with_suffix(".png")
        drawn = BytesIO()
        tables.plot(voltages=voltages).savefig(drawn, dpi=130, format=out.suffix[1:].lower())
        write_whole(out, drawn.getvalue())
    except (ValueError, ArithmeticError) as error:
        fail([f"{feeder}: {error}"], BAD_INPUT)
    except OSError as error:
        fail([refusal(out, error)], BAD_INPUT)
    typer.echo(f"Figure: {shown(out)}")


GROWN = """\
# {copies} copies of {feeder}, made by `gridpeers feeder grow`: all lose the substation at once and stay joined.
name = "{name}"
title = "{inverters} inverters in {copies} joined copies of {feeder}"

[plant]
feeder = "{name}"

[time]
T_c_s = {T_c}
end_s = 6.0

[[event]]
label = "islanding"
t_s = 1.0
open = [{switches}]

[case.none]
title = "droop alone"
secondary = "none"
graph = "none"

[case.ring]
title = "agents in a ring"
secondary = "all"
graph = "ring"

[case.clustered]
title = "all agents of a microgrid, and all leaders"
secondary = "all"
graph = "clustered"
"""


@app.command()
def grow(
    feeder: Annotated[
        str, typer.Argument(metavar="FEEDER", help="A feeder with a substation, switches and inverters.")
    ],
    copies: Annotated[int, typer.Option("--copies", metavar="N", help="How many, the first included.")],
    joint: Annotated[str, typer.Option("--joint", metavar="BUS", help="Bus of each copy that ties lead from and to.")],
    switch: Annotated[
        str, typer.Option("--switch", metavar="SWITCH", help="Switch that cuts a copy off the substation.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="New or empty folder for tables and scenario.")],
    T_c: Annotated[float, typer.Option("--T-c", metavar="SECONDS", help="Control period of the scenario.")] = 0.1,
) -> None:
    """Join copies of a feeder, and write their tables and a scenario that islands all of them.

    The copies hang on one substation, and are tied to each other in a chain beyond it.

    Exit code: 0 it was written, 2 the feeder or an option cannot be used.

    Example:  gridpeers feeder grow microgrid123 --copies 11 --joint 450 --switch 13-152 --out hundred
    """
    from gridpeers.feeder import Feeder
    from gridpeers.output_folders import FolderError, shown, whole_folder
    from gridpeers.plant.equipment.derived_feeders import copy_name, joined_copies
    from gridpeers.plant.tables import FeederError
    from gridpeers.wire.wording import suggestion

    try:
        tables = Feeder.read(feeder)
        grown = joined_copies(tables, copies, joint)
    except FeederError as error:
        refuse(error)
    except ValueError as error:
        fail([str(error)], BAD_INPUT)
    found = next((one for one in tables.switches if switch in one.names), None)
    if found is None:
        names = [one.alias or one.name for one in tables.switches]
        fail([f'--switch: no switch "{switch}"; {suggestion(switch, names, "switches")}'], BAD_INPUT)
    of_copies = (f"{copy_name(found.from_bus, k)}-{copy_name(found.to_bus, k)}" for k in range(1, copies + 1))
    text = GROWN.format(
        feeder=feeder,
        name=grown.name,
        copies=copies,
        inverters=len(grown.inverters),
        T_c=T_c,
        switches=", ".join(f'"{name}"' for name in of_copies),
    )
    try:
        with whole_folder(out):
            grown.save(out / grown.name)
            (out / "islanding.toml").write_text(text, encoding="utf-8")
    except FolderError as error:
        fail([str(error)], BAD_INPUT)
    size = f"{counted(len(grown.buses), 'bus', 'buses')}, {counted(len(grown.inverters), 'inverter')}"
    typer.echo(f"{size}: {shown(out / 'islanding.toml')}")


app.command()(glm)


def read_script(name: str, switches: list[str], leave_out: list[str]) -> Feeder:
    """Read a feeder that was written for another program, or end with every problem in it."""
    from gridpeers.feeder import reader_of
    from gridpeers.plant.tables import FeederError

    read = reader_of(name)
    if read is None:
        fail(
            [f"{name}: a feeder is a .dss file (OpenDSS) or a .glm file (GridLAB-D), by the end of its name"], BAD_INPUT
        )
    try:
        return read(name, switches=switches, leave_out=leave_out)
    except FeederError as error:
        refuse(error)


def save_readable(feeder: Feeder, folder: Path, script: str) -> None:
    """Write the tables of a script's feeder and read them again; end with every problem if a run could not."""
    from gridpeers.plant.tables import FeederError
    from gridpeers.rooms import ROOMS

    feeder.save(folder)
    try:
        feeder.read(folder)
    except FeederError as error:
        of_script = ROOMS.resolve("of_script")
        problems = dict.fromkeys(of_script(problem, folder, script, feeder.places) for problem in error.problems)
        refuse(FeederError(script, tuple(problems)))


def folder_of(name: str) -> str:
    """Return the name of a folder for a feeder, whose name comes from a script and may be any text.

    Examples
    --------
    >>> folder_of("ieee13"), folder_of("../up and away")
    ('ieee13', '_up_and_away')
    """
    return re.sub(r"[^\w.-]+", "_", name).lstrip(".-") or "feeder"


def _read(name: str, load_set: str | None, switch: list[str] | None, leave_out: list[str] | None) -> Feeder:
    """Read a feeder of tables or a script, or end with every problem in it."""
    from gridpeers.feeder import Feeder, reader_of
    from gridpeers.plant.tables import FeederError

    if reader_of(name):
        if load_set is not None:
            fail(
                [f"--load-set is for a folder of tables; {name} has the one set of loads that it describes"], BAD_INPUT
            )
        return read_script(name, switch or [], leave_out or [])
    if switch or leave_out:
        fail(["--switch and --leave-out are for .dss and .glm files; a folder's tables can be edited"], BAD_INPUT)
    try:
        return Feeder.read(name, load_set or "main")
    except FeederError as error:
        refuse(error)


def _describe(feeder: Feeder) -> None:
    from gridpeers.plant.equipment.imported_equipment import is_behind

    load, generation = (sum(by_bus.values()) / 1e3 for by_bus in (feeder.load_by_bus(), feeder.generation_by_bus()))
    buses = [bus for bus in feeder.buses if not is_behind(bus.name)]
    nodes = sum(len(bus.phases) for bus in buses)
    typer.echo(
        f"{feeder.name}: {counted(len(buses), 'bus', 'buses')}, {counted(nodes, 'node')}, "
        f"{load:.0f} kW of load, "
        f"{f'{generation:.0f} kW of constant generation, ' if generation else ''}"
        f"{counted(len(feeder.switches), 'switch', 'switches')}, {counted(len(feeder.inverters), 'inverter')}, "
        f"{feeder.f_nom:g} Hz"
    )
