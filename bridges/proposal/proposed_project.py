"""A project that islands a feeder of one's own: its tables with inverters, and a scenario that was tried."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
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
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.scenario import load
from gridpeers.scenarios.run_request import BrokenRunError
from gridpeers.scenarios.schema import ScenarioModel, load_scenario
from gridpeers.scenarios.schema.check_notes import start_problem
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.messages import OFF
from gridpeers.wire.wording import counted, first_of

SETTLE = 1.2
"""Time (s) given to the transient after the last event; the swings after it are judged."""

WINDOW = 0.4
"""Length (s) of each of the two windows that are compared: an oscillation of 3 Hz or more is there with a period."""

SWING = 0.02
"""Swing of a frequency (Hz) that is at rest."""

FIRST = 0.1
"""Time (s) to which the first event is moved: until then nothing happens."""


class Unrest(NamedTuple):
    """What keeps a plant from coming to rest."""

    text: str
    """"its frequencies swing by 0.35 Hz, and do not calm down", or what tripped, after which limit of a current."""
    limited: bool
    """Whether grid-forming inverters were at their current limit."""


def unsteady(scenario: ScenarioModel, feeder: Tables, case: str) -> Unrest | None:
    """Return what goes on after the last event on droop alone; None if the plant comes to rest."""
    config, _ = configs(scenario, feeder, case)
    settings = config.settings
    early = FIRST - min(_times(settings), default=FIRST)
    events = tuple(msgspec.structs.replace(event, t=round(event.t + early, 9)) for event in settings.events)
    loads = tuple(msgspec.structs.replace(event, t=round(event.t + early, 9)) for event in settings.loads)
    settings = msgspec.structs.replace(settings, events=events, loads=loads)
    plant = build_plant(msgspec.structs.replace(config, settings=settings))
    forming = [row.name for row in feeder.inverters if row.kind == "GFM"]
    last = max(_times(settings), default=FIRST)
    end, window = round((last + SETTLE) / config.T_c), round(WINDOW / config.T_c)
    found: list[list[float]] = []
    for _ in range(end):
        plant.advance()
        readings = plant.measure()
        found.append([readings[name].f if readings[name].island != OFF else np.nan for name in forming])
    happened = plant.take_events()
    limits = [event.text for event in happened if LIMITS in event.text][:1]
    trip = next((event.text for event in happened if event.kind == "trip"), "")
    if trip:
        return Unrest(", and ".join([*limits, trip]), bool(limits))
    f = np.array(found)
    before, after = (float(np.ptp(part, axis=0).max()) for part in (f[-2 * window : -window], f[-window:]))
    if after < SWING or after < 0.5 * before:
        return None
    return Unrest(f"its frequencies swing by {after:.2g} Hz, and do not calm down", bool(limits))


def _times(settings: PlantSettings) -> list[float]:
    """Return when (s) switches are operated and loads change."""
    return [*(event.t for event in settings.events), *(event.t for event in settings.loads)]


Project = tuple[ScenarioModel, Tables]
"""A scenario and its feeder."""

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
REMEDIES = {
    SLOW_VOLT_VAR: "[plant.gfl] has a slower volt-var droop, T_vf_s = 0.2",
    MORE_CURRENT: "[plant.gfm] allows more current, I_max_pu = 3",
    SLOW_VOLT_VAR + MORE_CURRENT: "[plant.gfl] has T_vf_s = 0.2, and [plant.gfm] I_max_pu = 3",
}
"""Settings with which the plant of a proposed scenario may come to rest on droop alone, and their words."""

BETA = """
[gains]
beta_GFM = {beta}  # 1 as a rule: here the vars would stay unequal where voltages differ along the feeder
beta_GFL = {beta}
"""
BETAS = 4.0, 16.0, 64.0
"""Weights of var sharing, beside that of the voltage error, to try where vars stay unequal."""

MUCH = 0.5
"""Part of the load from which on fixed generation is the likely cause."""

GRAPHS = {"ring": "agents in a ring", "clustered": "agents of each microgrid and all leaders"}
"""Graphs of a proposed scenario, and their words."""

PARTS = (1.0, 0.5, 0.25, 0.0)
"""Parts of the proposed P_set0 to try, until the plant can start: voltages rise with what inverters deliver."""

MOST_IN_RING = 15
"""Inverters up to which a ring is quick enough: agreement along it takes a time that goes with their square."""


def _with_proposal(
    script: str, switches: list[str], leave_out: list[str], count: int | None
) -> tuple[Feeder, Proposal]:
    """Return a feeder and its proposal; one without a switch to island at gets one near the substation."""
    feeder = read_script(script, switches, leave_out)
    try:
        return feeder, propose(feeder, count)
    except NoSwitchError as error:
        if not error.lines:
            raise
        line = error.lines[0]
    typer.echo(f"NOTE  no switch cuts half of the load off the substation; {line} is made one")
    feeder = read_script(script, [*switches, line], leave_out)
    return feeder, propose(feeder, count)


def _calmed(project: Project, rewritten: Callable[[str], Project], proposal: Proposal) -> str | None:
    """Return the settings with which a project comes to rest on droop alone, or None; say what they are."""
    if not (found := unsteady(*project, "none")):
        return ""
    for settings, words in REMEDIES.items():
        if (found.limited or MORE_CURRENT not in settings) and not unsteady(*rewritten(settings), "none"):
            typer.echo(f"NOTE  on droop alone, {found.text}: so {words}")
            return settings
    rewritten("")
    typer.echo(f"NOTE  on droop alone, {found.text}; {_remedy(project[1], proposal)}")
    return None


def _remedy(feeder: Tables, proposal: Proposal) -> str:
    """Return what may help where no settings do: with much fixed generation, to do without it."""
    if proposal.generation < MUCH * proposal.load:
        return "more --inverters give more leaders, or try another --switch"
    names = list(dict.fromkeys(part.name for part in feeder.load_parts if part.S.real < 0.0))
    return (
        f"{proposal.generation / 1e3:.0f} kW of fixed generation beside {proposal.load / 1e3:.0f} kW of load follow no "
        f"droop: leave out {first_of(names, 3)} (--leave-out), and add inverters at their buses"
    )


def _tried_with_agents(file: Path, case: str, settings: str, rewritten: Callable[[str], Project]) -> None:
    """Run the agents' case of a project: choose settings that pass its checks, and say which checks fail.

    Where more than var sharing fails and a leader was at its current limit, leaders get more current; where vars stay
    unequal, var sharing weighs more.
    """

    def failed() -> tuple[dict[str, str], bool]:
        result = load(file).run(case)
        verdicts = [row for row in result.check_verdicts if row.status == "failed"]
        told = {row.check: row.violations[0].sentence if row.violations else row.reason for row in verdicts}
        return told, any(LIMITS in text for text in result.events["text"])

    first, limited = failed()
    if set(first) - {"var_sharing"} and limited and MORE_CURRENT not in settings:
        rewritten(settings + MORE_CURRENT)
        found, _ = failed()
        if set(found) <= {"var_sharing"}:
            check, sentence = next(iter(first.items()))
            typer.echo(f"NOTE  case {case} fails its check {check}: {sentence}: so {REMEDIES[MORE_CURRENT]}")
            first, settings = found, settings + MORE_CURRENT
    found, beta, betas = first, 1.0, iter(BETAS)
    while set(found) == {"var_sharing"} and (beta := next(betas, 0.0)):
        rewritten(settings + BETA.format(beta=beta))
        found, _ = failed()
    if first and not found:
        words = f"so [gains] weighs var sharing more, beta_GFM = beta_GFL = {beta:g}"
        typer.echo(f"NOTE  case {case}, {first['var_sharing']}: {words}")
    elif first:
        rewritten(settings)
        for check, sentence in first.items():
            typer.echo(f"NOTE  case {case} fails its check {check}: {sentence}")


def propose_project(folder: Path, script: Path, switches: list[str], leave_out: list[str], count: int | None) -> None:
    """Import a feeder, and write its tables with proposed inverters, and a scenario that islands it."""
    try:
        feeder, proposal = _with_proposal(str(script), switches, leave_out, count)
    except NoProposalError as error:
        fail([f"{script}: {error}"], BAD_INPUT)
    name = folder_of(feeder.name)
    save_readable(msgspec.structs.replace(feeder, inverters=proposal.inverters), folder / name, script.name)
    file = folder / "islanding.toml"
    graph = "ring" if len(proposal.inverters) <= MOST_IN_RING else "clustered"

    def written(part: float, settings: str = "") -> Project:
        text = SCENARIO.format(
            feeder=feeder.name,
            folder=name,
            switch=json.dumps(proposal.switch),  # names of scripts may have quotes
            P_set0=round(part * proposal.P_set0, 3),
            settings=settings,
            graph=graph,
            agents=GRAPHS[graph],
            title=json.dumps(f"Islanding of {feeder.name} at {proposal.switch}"),
        )
        file.write_text(text, encoding="utf-8")
        return load_scenario(str(file))

    problem = ""
    with explained(lambda: typer.echo(TRYING)):
        for part in PARTS:
            found = start_problem(*(project := written(part)))
            if not found:
                rewritten = partial(written, part)
                settings = _calmed(project, rewritten, proposal)
                if settings is not None:
                    try:
                        _tried_with_agents(file, graph, settings, rewritten)
                    except BrokenRunError as error:
                        rewritten(settings)
                        typer.echo(f"NOTE  case {graph} was not checked, as a run of it broke: {error}")
                break
            problem = problem or found
    if found:
        check = command_line("check", str(file))
        typer.echo(f"NOTE  it cannot start yet: {problem}; edit the inverters, then: {check}")
    if count is not None and len(proposal.inverters) < count:
        typer.echo(f"NOTE  no bus for more than {len(proposal.inverters)} of the {count} inverters of --inverters")
    for text in returns_in_words(msgspec.structs.replace(feeder, inverters=proposal.inverters)):
        typer.echo(f"NOTE  {text}")
    rated = sum(row.P_rated for row in proposal.inverters) / 1e3
    typer.echo(
        f"{feeder.name}: switch {proposal.switch} islands {proposal.load / 1e3:.0f} kW of load; "
        f"{counted(len(proposal.inverters), 'inverter')}, {rated:.0f} kW in all, proposed"
    )
