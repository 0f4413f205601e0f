"""From a name or a path to a scenario that can be run, or to all that is wrong with it."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from gridpeers.plant.equipment import F_NOM, Tables
from gridpeers.plant.simulators import SIMULATORS
from gridpeers.plant.tables import FeederError, feeders, is_folder, read_feeder
from gridpeers.scenarios.catalogue_files import CATALOGUE, names_in
from gridpeers.scenarios.schema import checks, participants
from gridpeers.scenarios.schema.configs import as_in, configs
from gridpeers.scenarios.schema.plugin_keys import check_plugins, with_folders, with_model_folders
from gridpeers.scenarios.schema.scenario_errors import Problems, ScenarioError
from gridpeers.scenarios.schema.scenario_model import AS_RUN, ScenarioModel
from gridpeers.scenarios.schema.supply import check_loads, check_supply
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.text_file import TextFileError, text_of
from gridpeers.wire.wording import suggestion

ReadFeeder = Callable[[str, str], Tables]


def catalogue() -> tuple[str, ...]:
    """Return the names of the scenarios of the catalogue."""
    return names_in(CATALOGUE)


def find_scenario(name: str) -> Path:
    return find_file(name, CATALOGUE, "scenario")


def find_file(name: str, folder: Path, what: str) -> Path:
    """Return the path of a file named as in a catalogue, or given as a path; `what` names its kind in ScenarioError."""
    names = names_in(folder)
    if name in names:
        return folder / f"{name}.toml"
    path = Path(name)
    listed = ", ".join(names)
    try:
        is_file, is_dir = path.is_file(), path.is_dir()
    except OSError as error:  # a name too long, a folder that is closed to us
        raise ScenarioError([f"{name}: cannot be read: {error.strerror}"]) from None
    if is_file:
        return path
    if is_dir:
        raise ScenarioError([f"{name}: this is a folder; give a {what} file (.toml) or a name: {listed}"])
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise ScenarioError([f"{name}: there is no such file; give the path of a {what} file, or a name: {listed}"])
    raise ScenarioError([f'no {what} "{name}"; {suggestion(name, names, f"{what}s of the catalogue")}'])


def load_scenario(name: str | Path) -> tuple[ScenarioModel, Tables]:
    """Read and check a scenario of the catalogue or a file, and its feeder; ScenarioError has every problem of both."""
    path = find_scenario(str(name))
    text, data = read_toml(path)
    problems = Problems(path.name, text)
    scenario, feeder = check_tables(data, path, problems)
    problems.raise_if_any()
    assert feeder is not None
    return scenario, feeder


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    try:
        text = text_of(path.read_bytes())
    except TextFileError as error:
        raise ScenarioError([f"{path.name}: {error}"]) from None
    except OSError as error:
        raise ScenarioError([f"{path}: cannot be read: {error.strerror}"]) from None
    try:
        return text, tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # no TOML, a number of thousands of digits, or brackets as deep
        raise ScenarioError([_malformed(path.name, text, str(error))]) from None


def read_tables(data: Mapping[str, Any], problems: Problems) -> ScenarioModel:
    """Return the scenario of parsed TOML; it is of use only while no problem is noted."""
    tables = {key: value for key, value in data.items() if key != AS_RUN}
    match tables.get("plant"):
        case {"helics": {"federates": 0, **helics}, **plant}:  # runs saved until November 2026 have it
            tables["plant"] = plant | {"helics": helics}
    return problems.read(ScenarioModel, tables)


def check_tables(
    data: Mapping[str, Any], path: Path, problems: Problems, read_feeder: ReadFeeder = read_feeder
) -> tuple[ScenarioModel, Tables | None]:
    """Read the tables of a scenario and note every problem; the scenario is of use only if there is none.

    Relative paths start at the folder of `path`, whose name is that of a scenario without one.
    """
    if not data:
        init = command_line("init", "my-study")
        raise ScenarioError([f"{problems.file}: is empty; {init} makes a project with a scenario to start from"])
    scenario = read_tables(with_model_folders(data, path.parent), problems)
    if not scenario.name:
        scenario = replace(scenario, name=checks.name_of(path.stem))
    checks.check_times(scenario, problems)
    checks.check_names(scenario, problems)
    scenario = with_folders(scenario, path.parent)
    feeder_path = scenario.plant.feeder
    if feeder_path not in feeders() and is_folder(path.parent / feeder_path):  # processes may start elsewhere
        plant = replace(scenario.plant, feeder=str((path.parent / feeder_path).resolve()))
        scenario = replace(scenario, plant=plant)
    scenario = participants.with_delays(scenario, path.parent, problems)
    feeder = _feeder_of(scenario, problems, read_feeder)
    checks.check_step(scenario, feeder, problems)
    checks.check_protection(scenario, feeder.f_nom if feeder else F_NOM, problems)
    inverters = participants.inverters_of(scenario, feeder) if feeder else ()
    checks.check_cases(scenario, tuple(row.name for row in inverters), problems)
    check_plugins(scenario, feeder, problems)
    checks.check_events(scenario, problems)
    participants.check_simulator(scenario, problems)
    participants.check_netem(scenario, feeder, problems)
    if feeder:
        checks.check_changes(scenario, feeder, problems)
        participants.check_agentless(scenario, feeder, problems)
        checks.check_moves(scenario, feeder, problems)
        checks.check_limits(scenario, feeder, problems)
        check_loads(scenario, feeder, problems)
        checks.check_start(scenario, feeder, problems)
        check_supply(scenario, feeder, problems)
        if not problems.touch("plant.simulator"):
            SIMULATORS.resolve(scenario.plant.simulator).check(scenario, feeder, problems)
    return scenario, feeder


def start_problem(scenario: ScenarioModel, feeder: Tables) -> str:
    """Return why the plant has no operating point at t = 0, or cannot operate an event's switches; "" if it can."""
    if SIMULATORS.resolve(scenario.plant.simulator).elsewhere:  # it finds its own
        return ""
    from gridpeers.plant.build import plant_at_rest  # the compiled step
    from gridpeers.plant.dynamics import PlantError

    plant, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    try:
        plant_at_rest(plant)
    except (PlantError, ValueError) as error:
        return str(error)
    return ""


def _malformed(file: str, text: str, reason: str) -> str:
    lines = text.rstrip().splitlines() or [""]
    match = re.search(r"\(at line (\d+)", reason)
    line = min(int(match[1]), len(lines)) if match else len(lines)
    return f"{file}:{line}: not valid TOML: {reason.partition(' (at')[0]}: {lines[line - 1].strip()}"


def _feeder_of(scenario: ScenarioModel, problems: Problems, read_feeder: ReadFeeder) -> Tables | None:
    if problems.touch("plant.feeder"):
        return None
    name, load_set = scenario.plant.feeder, scenario.plant.load_set
    try:
        feeder = read_feeder(name, load_set)
    except FeederError as error:
        keys = {_note(problem, Path(name).name, problems) for problem in error.problems}
        if keys != {"plant.load_set"}:
            return None
        try:  # with another load set than the one that does not exist, to check the rest of the scenario on
            return read_feeder(name, "main")
        except FeederError:
            return None
    if not feeder.inverters:
        problems.add("plant.feeder", f'feeder "{feeder.name}" has no inverters, so there is nothing to control')
        return None
    return as_in(scenario, feeder)


def _note(problem: str, feeder: str, problems: Problems) -> str:
    """Note a problem of a feeder; return the scenario's key that caused it, or "" when the feeder itself did."""
    key = {"load set": "plant.load_set", "feeder": "plant.feeder"}.get(problem.partition(' "')[0], "")
    if key:
        problems.add(key, problem)
    else:
        problems.add_plain(f'feeder "{feeder}": {problem}')
    return key
