"""The command `gridpeers feeder grow`: a larger feeder from copies of one, for studies of scale."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, refuse
from gridpeers.wire.wording import counted

SCENARIO = """\
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
    text = SCENARIO.format(
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
