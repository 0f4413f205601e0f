"""Check before a run that the law exists, accepts its parameters, and can be made."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gridpeers.agents.agent_config import LawChoice
from gridpeers.agents.carriers.law_registry import CARRIERS, KEYS, LAWS, shared_by
from gridpeers.agents.carriers.time_limit import make_limited
from gridpeers.agents.laws.law import Law, limits_in
from gridpeers.wire.plugins.plugin import scalar_objection
from gridpeers.wire.plugins.registry import PluginError
from gridpeers.wire.schema.table_reading import read_parameters, read_table
from gridpeers.wire.schema.table_schema import Problem
from gridpeers.wire.wording import is_no_path

PAPER = LawChoice().use

OF_PLANT = ("t", "f", "P", "Q", "V", "P_set", "V_set")  # quantities of a record beside shared ones


def law_problems(table: Mapping[str, Any]) -> list[Problem]:
    """Return all problems of the table `law` of a scenario, each at its key, or at "" for the whole table."""
    given = [key for key in CARRIERS if key in table]
    if len(given) != 1:
        text = f"needs one of use, command, fmu; got {' and '.join(given) or 'none'}"
        return [Problem("", f'{text}; e.g. law = "mine:Mine" or law = {{ command = ["./mylaw"] }}')]
    choice, found = read_table(LawChoice, {key: value for key, value in table.items() if key in KEYS})
    rest = {key: value for key, value in table.items() if key not in KEYS}
    found += [Problem(key, text) for key, value in rest.items() if (text := scalar_objection(value))]
    for key in ("use", "fmu", "folder"):
        if is_no_path(getattr(choice, key)):
            found.append(Problem(key, "cannot be the name of a module, folder or file"))
    if "command" in table and not any(it.path == "command" for it in found):
        found += [Problem("command", text) for text in _command_problems(choice.command)]
    wrong = {problem.path for problem in found}
    if wrong & {*CARRIERS, "folder"}:  # the law is not known
        return found
    parameters = {key: value for key, value in rest.items() if key not in wrong}
    checks = {"use": _class_problems, "command": _program_problems, "fmu": _fmu_problems}
    found += checks[given[0]](choice, parameters)
    if choice.shared and not choice.command:
        found.append(Problem("shared", "is for a program; a class declares fields, an FMU outputs shared_NAME"))
    elif taken := [it.name for it in shared_by(choice) if not found and it.name in OF_PLANT]:
        found.append(Problem(given[0], f"shares {taken[0]}, a quantity of the plant; give it another name"))
    return found


def _command_problems(command: tuple[str, ...]) -> list[str]:
    if not command:
        return ["is empty; write the program first"]
    if is_no_path(command[0]):
        return ["begins with a text that cannot be the name of a program"]
    wrong = any("\0" in word or not (word.isprintable() or word.isascii()) for word in command)
    return ["has a character that a command cannot have"] if wrong else []


def _class_problems(choice: LawChoice, parameters: Mapping[str, Any]) -> list[Problem]:
    if choice.use == PAPER:
        text = f'the parameters of "{PAPER}" are those of [gains] and [degraded_communication]; write them there'
        return [Problem(key, text) for key in parameters]
    try:
        law = LAWS.resolve(choice.use, choice.folder)
    except PluginError as error:
        return [Problem("use", str(error))]
    if found := read_parameters(law, parameters)[1]:
        return found
    try:
        make_limited(law, parameters, choice.time_limit).close()
    except ValueError as error:
        return [Problem("use", f"{choice.use} {error}")]
    return []


def _program_problems(choice: LawChoice, parameters: Mapping[str, Any]) -> list[Problem]:
    program, folder = choice.command[0], Path(choice.folder)
    if not folder.is_dir():
        return [Problem("folder", f"there is no folder {folder}")]
    place = folder / program
    if shutil.which(str(place.resolve())) or ("/" not in program and shutil.which(program)):
        return read_parameters(Law, limits_in(parameters))[1]
    if place.is_file():
        return [Problem("command", f"{program} is not executable; chmod +x it, or name its interpreter first")]
    return [Problem("command", f"there is no program {program}, neither beside the scenario nor on the PATH")]


def _fmu_problems(choice: LawChoice, parameters: Mapping[str, Any]) -> list[Problem]:
    from gridpeers.agents.carriers.fmu import fmu_problems

    return [Problem(*problem) for problem in fmu_problems(Path(choice.folder) / choice.fmu, parameters)]
