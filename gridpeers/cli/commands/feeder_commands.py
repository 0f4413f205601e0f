"""The commands `gridpeers feeder ...`: import a feeder, check it, solve it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from gridpeers.cli.usage import Commands, LeaveOut, Switches, argument, fail, option
from gridpeers.feeder import Feeder, is_foreign
from gridpeers.output_folders import files_written, shown, whole_folder, write_whole
from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.plant.equipment.imported_equipment import is_behind
from gridpeers.plant.tables import FeederError, feeders
from gridpeers.rooms import ROOMS
from gridpeers.wire.wording import counted

app = typer.Typer(cls=Commands, no_args_is_help=True, rich_markup_mode=None, help="Import, check and solve feeders.")

FeederName = Annotated[
    str, argument("FEEDER", "A feeder that comes with gridpeers, a folder of tables, or a .dss or .glm file.")
]
LoadSet = Annotated[str | None, option("NAME", "Load table of the feeder; main if left out.", "--load-set")]
SHOWN = 12  # Notes that are shown


@app.command("import")
def import_(
    file: Annotated[Path, argument("FILE", "Script for OpenDSS (.dss) or model for GridLAB-D (.glm).")],
    out: Annotated[Path | None, typer.Option(help="Folder for the tables; named after the feeder if left out.")] = None,
    switch: Switches = None,
    leave_out: LeaveOut = None,
) -> None:
    """Read a feeder of OpenDSS or GridLAB-D, and write it as tables for a scenario.

    Example:  gridpeers feeder import Master.dss --out my-feeder
    """
    feeder = read_script(file, switch, leave_out)
    folder = out or Path(folder_of(feeder.name))
    with whole_folder(folder):
        save_readable(feeder, folder, file.name)
    _describe(feeder)
    notes = [*feeder.notes[:SHOWN]]
    if len(feeder.notes) > SHOWN:
        notes.append(f"and {len(feeder.notes) - SHOWN} more")
    if str(folder) in feeders():
        notes.append(f'in a scenario write "./{folder}": "{folder}" is the feeder that comes with gridpeers')
    for note in notes:
        typer.echo(f"NOTE  {note}")
    typer.echo(f"Tables: {shown(folder)}")


@app.command()
def check(feeder: FeederName, load_set: LoadSet = None, switch: Switches = None, leave_out: LeaveOut = None) -> None:
    """Check a feeder; show its size, and the load that each switch cuts off.

    Example:  gridpeers feeder check microgrid123
    """
    tables = Feeder.read(feeder, load_set, switches=switch or (), leave_out=leave_out or ())
    _describe(tables)
    graph, load_by_bus = Connectivity(tables), tables.load_by_bus()
    for each in tables.switches:
        state = "open" if not each.closed else "closed; opening it cuts nothing off"
        if each.closed and (behind := graph.cut_off(each)):
            kW = sum(load_by_bus.get(bus, 0.0) for bus in behind) / 1e3
            cut = [counted(len(behind), "bus", "buses"), f"{kW:.0f} kW of load"]
            cut += [row.name for row in tables.inverters if row.bus in behind]
            state = f"closed; opening it cuts off {', '.join(cut)}"
        typer.echo(f"switch {each.alias or each.name}: {state}")


@app.command()
def solve(
    feeder: FeederName,
    open_: Annotated[list[str] | None, option("SWITCH", "Switch to open first; repeatable.", "--open")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file for all voltages.")] = None,
    load_set: LoadSet = None,
    switch: Switches = None,
    leave_out: LeaveOut = None,
) -> None:
    """Solve the power flow from the substation, without inverters; show the lowest and highest voltages.

    Example:  gridpeers feeder solve microgrid123 --open 13-152
    """
    tables = Feeder.read(feeder, load_set, switches=switch or (), leave_out=leave_out or ())
    try:
        table = tables.solve(open_ or ())
    except (ValueError, ArithmeticError) as error:
        fail(f"{feeder}: {error}")
    if csv is not None:
        with files_written(csv):
            write_whole(csv, table.to_csv(index=False))
    phases = table[table["phase"].isin(list("ABC"))]
    live = phases[phases["V"] > 0.0]
    text = f"{counted(len(live), 'node')} with voltage"
    if dead := len(phases) - len(live):
        text += f", {dead} without, as the substation does not reach {'it' if dead == 1 else 'them'}"
    if others := len(table) - len(phases):
        text += f"; {counted(others, 'further node')} (neutrals) not counted"
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
        typer.echo(f"Voltages: {shown(csv)}")


def read_script(file: Path, switches: list[str] | None, leave_out: list[str] | None) -> Feeder:
    """Read a feeder of another program."""
    if not is_foreign(file):
        fail(f"{file}: the file of a feeder ends in .dss (OpenDSS) or .glm (GridLAB-D)")
    return Feeder.read(file, switches=switches or (), leave_out=leave_out or ())


def save_readable(feeder: Feeder, folder: Path, script: str) -> None:
    """Write the tables of a script's feeder and read them again; end with every problem if a run could not."""
    feeder.save(folder)
    try:
        feeder.read(folder)
    except FeederError as error:
        of_script = ROOMS.resolve("of_script")
        problems = dict.fromkeys(of_script(problem, folder, script, feeder.places) for problem in error.problems)
        raise FeederError(script, tuple(problems)) from None


def folder_of(name: str) -> str:
    """Return a folder name for a feeder, whose own name may be any text.

    >>> folder_of("ieee13"), folder_of("../up and away")
    ('ieee13', '_up_and_away')
    """
    return re.sub(r"[^\w.-]+", "_", name).lstrip(".-") or "feeder"


def _describe(feeder: Feeder) -> None:
    load, generation = (sum(by_bus.values()) / 1e3 for by_bus in (feeder.load_by_bus(), feeder.generation_by_bus()))
    buses = [bus for bus in feeder.buses if not is_behind(bus.name)]
    parts = [
        counted(len(buses), "bus", "buses"),
        counted(sum(len(bus.phases) for bus in buses), "node"),
        f"{load:.0f} kW of load",
        *([f"{generation:.0f} kW of constant generation"] if generation else []),
        counted(len(feeder.switches), "switch", "switches"),
        counted(len(feeder.inverters), "inverter"),
        f"{feeder.f_nom:g} Hz",
    ]
    typer.echo(f"{feeder.name}: {', '.join(parts)}")
