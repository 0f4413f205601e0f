"""A project that islands a feeder of one's own: its tables with inverters, and a scenario that was tried."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import typer

from gridpeers.bridges.proposal.feeder_proposal import NoProposalError, NoSwitchError, Proposal, propose
from gridpeers.cli.commands.feeder_commands import folder_of, read_script, save_readable
from gridpeers.cli.progress import TRYING, explained
from gridpeers.cli.usage import BAD_INPUT, fail
from gridpeers.feeder import Feeder
from gridpeers.plant.build import build_plant
from gridpeers.plant.equipment import Feeder as Tables
from gridpeers.plant.equipment.neutrals import returns_in_words
from gridpeers.plant.feeder.limit_events import LIMITS
from gridpeers.scenario import load
from gridpeers.scenarios.run_request import BrokenRunError
from gridpeers.scenarios.schema import ScenarioModel, load_scenario
from gridpeers.scenarios.schema.check_notes import start_problem
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.messages import OFF
from gridpeers.wire.wording import counted

SETTLE = 1.2  # time (s) given to the transient after the last event; the swings after it are judged
WINDOW = 0.4
"""Length (s) of each of the two windows that are compared: an oscillation of 3 Hz or more is there with a period."""

SWING = 0.02  # swing of a frequency (Hz) that is at rest


class Unrest(NamedTuple):
    """The reason why a plant does not come to rest, in words, and whether leaders reached their current limit."""

    text: str
    limited: bool


def unsteady(scenario: ScenarioModel, feeder: Tables, case: str) -> Unrest | None:
    """Return what goes on after the last event on droop alone; None if the plant comes to rest."""
    config, _ = configs(scenario, feeder, case)
    plant = build_plant(config)
    forming = [row.name for row in feeder.inverters if row.kind == "GFM"]
    settings = config.settings
    last = max([*(event.t for event in settings.events), *(event.t for event in settings.loads)], default=0.0)
    f: list[list[float]] = []
    for _ in range(round((last + SETTLE) / config.T_c)):
        plant.advance()
        readings = plant.measure()
        f.append([readings[name].f if readings[name].island != OFF else np.nan for name in forming])
    happened = plant.take_events()
    limits = [event.text for event in happened if LIMITS in event.text][:1]
    if trips := [event.text for event in happened if event.kind == "trip"][:1]:
        return Unrest(", and ".join([*limits, *trips]), bool(limits))
    window = round(WINDOW / config.T_c)
    before, after = (float(np.ptp(part, axis=0).max()) for part in (f[-2 * window : -window], f[-window:]))
    if after < SWING or after < 0.5 * before:
        return None
    return Unrest(f"its frequencies swing by {after:.2g} Hz, and do not calm down", bool(limits))


SCENARIO = """\
# A first islanding of {feeder}, proposed by `gridpeers init`: edit it, and {folder}/inverters.csv.
name = "islanding"
title = {title}

[plant]
feeder = "./{folder}"
P_set0_pu = {P_set0}  # the substation gives the rest
{settings}
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

[case.{graph}]
title = "secondary control, {agents}"
secondary = "all"
graph = "{graph}"
"""
"""Scenario file of a feeder of one's own."""

SLOW_VOLT_VAR = """
[plant.gfl]
T_vf_s = 0.2  # 0.05 as a rule: here the volt-var droop would oscillate with the network between leader and followers
"""
MORE_CURRENT = """
[plant.gfm]
I_max_pu = 3.0  # 2.0 as a rule: here a phase would stay at the limit, with too low a voltage to recover
"""
REMEDIES = {  # settings with which the plant of a proposed scenario may come to rest on droop alone, and their words
    SLOW_VOLT_VAR: "[plant.gfl] has a slower volt-var droop, T_vf_s = 0.2",
    MORE_CURRENT: "[plant.gfm] allows more current, I_max_pu = 3",
    SLOW_VOLT_VAR + MORE_CURRENT: "[plant.gfl] has T_vf_s = 0.2, and [plant.gfm] I_max_pu = 3",
}

BETA = """
[gains]
beta_GFM = {beta}  # 1 as a rule: here the vars would stay unequal where voltages differ along the feeder
beta_GFL = {beta}
"""
VARS = {"var_sharing"}  # check that fails where vars stay unequal
BETAS = 4.0, 16.0, 64.0  # weights of var sharing, beside that of the voltage error, to try where vars stay unequal
GRAPHS = {"ring": "agents in a ring", "clustered": "agents of each microgrid and all leaders"}
"""Graphs of a proposed scenario, and their words."""

PARTS = (1.0, 0.5, 0.25, 0.0)
"""Parts of the proposed P_set0 to try, until the plant can start: voltages rise with what inverters deliver."""

MOST_IN_RING = 15
"""Inverters up to which a ring is quick enough: agreement along it takes a time that goes with their square."""


class _Project:
    """The scenario file of a proposal, written anew with each setting that is tried."""

    def __init__(self, folder: Path, feeder: Feeder, proposal: Proposal) -> None:
        self.feeder_name, self.proposal = feeder.name, proposal
        self.file, self.tables = folder / "islanding.toml", folder_of(feeder.name)
        self.graph = "ring" if len(proposal.inverters) <= MOST_IN_RING else "clustered"
        self.part = 1.0
        self.settings = ""

    def write(self, settings: str = "") -> tuple[ScenarioModel, Tables]:
        """Write it with `part` of the proposed P_set0, and settings; return what a run reads."""
        self.settings = settings
        text = SCENARIO.format(
            feeder=self.feeder_name,
            folder=self.tables,
            switch=json.dumps(self.proposal.switch),  # names of scripts may have quotes
            P_set0=round(self.part * self.proposal.P_set0, 3),
            settings=settings,
            graph=self.graph,
            agents=GRAPHS[self.graph],
            title=json.dumps(f"Islanding of {self.feeder_name} at {self.proposal.switch}"),
        )
        self.file.write_text(text, encoding="utf-8")
        return load_scenario(str(self.file))

    def can_start(self) -> bool:
        """Choose the largest part of P_set0 with which the plant starts; say why there is none."""
        problems = []
        for part in PARTS:
            self.part = part
            if not (problem := start_problem(*self.write())):
                return True
            problems.append(problem)
        check = command_line("check", str(self.file))
        typer.echo(f"NOTE  it cannot start yet: {problems[0]}; edit the inverters, then: {check}")
        return False

    def calmed(self) -> bool:
        """Choose settings with which the plant comes to rest on droop alone; say what was changed, or what fails."""
        if not (found := unsteady(*self.write(), "none")):
            return True
        for settings, words in REMEDIES.items():
            worth_a_try = found.limited or MORE_CURRENT not in settings
            if worth_a_try and not unsteady(*self.write(settings), "none"):
                typer.echo(f"NOTE  on droop alone, {found.text}: so {words}")
                return True
        self.write()
        typer.echo(f"NOTE  on droop alone, {found.text}; more --inverters give more leaders, or try another --switch")
        return False

    def tried_with_agents(self) -> None:
        """Choose settings with which the agents' case passes its checks, and say which checks fail.

        Where more than var sharing fails and a leader was at its current limit, leaders get more current; where vars
        stay unequal, var sharing weighs more.
        """
        chosen, case = self.settings, f"NOTE  case {self.graph}"
        failed, limited = self._failed_checks(chosen)
        if failed.keys() - VARS and limited and MORE_CURRENT not in chosen:
            left, _ = self._failed_checks(chosen + MORE_CURRENT)
            if left.keys() <= VARS:
                check, sentence = next(iter(failed.items()))
                typer.echo(f"{case} fails its check {check}: {sentence}: so {REMEDIES[MORE_CURRENT]}")
                chosen, failed = chosen + MORE_CURRENT, left
        left = failed
        for beta in BETAS:
            if left.keys() != VARS:
                break
            left, _ = self._failed_checks(chosen + BETA.format(beta=beta))
            if not left:
                words = f"so [gains] weighs var sharing more, beta_GFM = beta_GFL = {beta:g}"
                typer.echo(f"{case}, {failed['var_sharing']}: {words}")
                return
        self.write(chosen)
        for check, sentence in failed.items():
            typer.echo(f"{case} fails its check {check}: {sentence}")

    def _failed_checks(self, settings: str) -> tuple[dict[str, str], bool]:
        """Run the agents' case; return what its failed checks say, and whether a leader was at its current limit."""
        self.write(settings)
        result = load(self.file).run(self.graph)
        failed = [row for row in result.check_verdicts if row.status == "failed"]
        told = {row.check: row.violations[0].sentence if row.violations else row.reason for row in failed}
        return told, any(LIMITS in text for text in result.events["text"])


def propose_project(folder: Path, script: Path, switches: list[str], leave_out: list[str], count: int | None) -> None:
    """Import a feeder, and write its tables with proposed inverters, and a scenario that islands it.

    A feeder without a switch to island at gets one near the substation.
    """
    try:
        feeder = read_script(str(script), switches, leave_out)
        try:
            proposal = propose(feeder, count)
        except NoSwitchError as error:
            if not error.lines:
                raise
            line = error.lines[0]
            typer.echo(f"NOTE  no switch cuts half of the load off the substation; {line} is made one")
            feeder = read_script(str(script), [*switches, line], leave_out)
            proposal = propose(feeder, count)
    except NoProposalError as error:
        fail([f"{script}: {error}"], BAD_INPUT)
    with_inverters = msgspec.structs.replace(feeder, inverters=proposal.inverters)
    project = _Project(folder, feeder, proposal)
    save_readable(with_inverters, folder / project.tables, script.name)
    with explained(lambda: typer.echo(TRYING)):
        if project.can_start() and project.calmed():
            settings = project.settings
            try:
                project.tried_with_agents()
            except BrokenRunError as error:
                project.write(settings)
                typer.echo(f"NOTE  case {project.graph} was not checked, as a run of it broke: {error}")
    if count is not None and len(proposal.inverters) < count:
        typer.echo(f"NOTE  no bus for more than {len(proposal.inverters)} of the {count} inverters of --inverters")
    for text in returns_in_words(with_inverters):
        typer.echo(f"NOTE  {text}")
    rated = sum(row.P_rated for row in proposal.inverters) / 1e3
    typer.echo(
        f"{feeder.name}: switch {proposal.switch} islands {proposal.load / 1e3:.0f} kW of load; "
        f"{counted(len(proposal.inverters), 'inverter')}, {rated:.0f} kW in all, proposed"
    )
