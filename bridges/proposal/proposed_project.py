"""A project that islands a feeder of one's own: its tables with inverters, and a scenario that can start."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import typer

from gridpeers.bridges.proposal.feeder_proposal import NoProposalError, NoSwitchError, Proposal, propose
from gridpeers.cli.commands.feeder_commands import folder_of, read_script, save_readable
from gridpeers.cli.progress import TRYING, explained
from gridpeers.cli.usage import fail
from gridpeers.feeder import Feeder
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.loading import start_problem
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import counted

SCENARIO = """\
# A first islanding of {feeder}, proposed by `gridpeers init`: edit it, and {folder}/inverters.csv.
name = "islanding"
title = {title}

[plant]
feeder = "./{folder}"
P_set0_pu = {P_set0}  # the substation gives the rest

[time]
end_s = 6.0

[[event]]
label = "islanding"
t_s = 1.0
open = [{switch}]

[case.none]
title = "droop alone"
secondary = "none"
graph = "none"
expected_failures = ["frequency", "var_sharing"]  # droop alone restores neither

[case.{graph}]
title = "secondary control, {agents}"
secondary = "all"
graph = "{graph}"
"""
"""Scenario file of a feeder of one's own."""

GRAPHS = {"ring": "agents in a ring", "clustered": "agents of each microgrid and all leaders"}
"""Graphs of a proposed scenario, and their words."""

PARTS = (1.0, 0.5, 0.25, 0.0)
"""Parts of the proposed P_set0 to try, until the plant can start: voltages rise with what inverters deliver."""

MOST_IN_RING = 15
"""Inverters up to which a ring is quick enough: agreement along it takes a time that goes with their square."""


def propose_project(folder: Path, script: Path, switches: list[str], leave_out: list[str]) -> None:
    """Import a feeder, and write its tables with proposed inverters, and a scenario that islands it.

    A feeder without a switch to island at gets one near the substation.
    """
    try:
        feeder = read_script(script, switches, leave_out)
        try:
            proposal = propose(feeder)
        except NoSwitchError as error:
            if not error.lines:
                raise
            line = error.lines[0]
            typer.echo(f"NOTE  no switch cuts half of the load off the substation, so {line} becomes a switch")
            feeder = read_script(script, [*switches, line], leave_out)
            proposal = propose(feeder)
    except NoProposalError as error:
        fail(f"{script}: {error}")
    with_inverters = msgspec.structs.replace(feeder, inverters=proposal.inverters)
    save_readable(with_inverters, folder / folder_of(feeder.name), script.name)
    with explained(lambda: typer.echo(TRYING)):
        _write_scenario(folder / "islanding.toml", feeder, proposal)
    rated = sum(row.P_rated for row in proposal.inverters) / 1e3
    typer.echo(
        f"{feeder.name}: switch {proposal.switch} islands {proposal.load / 1e3:.0f} kW of load; "
        f"{counted(len(proposal.inverters), 'inverter')}, {rated:.0f} kW in all, proposed"
    )


def _write_scenario(file: Path, feeder: Feeder, proposal: Proposal) -> None:
    """Write the scenario with the largest part of the proposed P_set0 with which the plant starts, or say why not."""
    graph = "ring" if len(proposal.inverters) <= MOST_IN_RING else "clustered"
    problems = []
    for part in PARTS:
        text = SCENARIO.format(
            feeder=feeder.name,
            folder=folder_of(feeder.name),
            switch=json.dumps(proposal.switch),  # names of scripts may have quotes
            P_set0=round(part * proposal.P_set0, 3),
            graph=graph,
            agents=GRAPHS[graph],
            title=json.dumps(f"Islanding of {feeder.name} at {proposal.switch}"),
        )
        file.write_text(text, encoding="utf-8")
        if not (problem := start_problem(*load_scenario(str(file)))):
            return
        problems.append(problem)
    check = command_line("check", str(file))
    typer.echo(f"NOTE  it cannot start yet: {problems[0]}; edit the inverters, then: {check}")
