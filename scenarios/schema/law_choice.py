"""The key `law` of a scenario and of its cases: which control law the agents run, with which parameters."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from agents.agent_config import Gains, LawChoice
from agents.carriers.executable import executable_problem
from agents.carriers.law_registry import CARRIERS, KEYS, LAWS
from agents.carriers.time_limit import make_limited
from agents.laws.law import Law, limits_in
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import LawKey, ScenarioModel
from wire.module_folder import folder_of
from wire.path_text import is_no_path
from wire.plausible import Range
from wire.plugin import scalar_objection, table_of
from wire.registry import PluginError
from wire.table_reading import read_parameters

PAPER = LawChoice().use
"""Name of the paper's law; its parameters are `[gains]` and `[handling]`."""

TIME_LIMIT = Range(0.001, 60.0)
"""What a time limit may be (s)."""


def law_of(scenario: ScenarioModel, case: str) -> LawChoice:
    """Return the law of a case: its own, or the scenario's.

    Examples
    --------
    >>> from scenarios.schema import load_scenario
    >>> law_of(load_scenario("islanding")[0], "IV").use
    'consensus'
    """
    table = table_of(scenario.cases[case].law or scenario.law)
    return LawChoice(
        use=table.get("use", PAPER),
        command=tuple(table.get("command", ())),
        fmu=table.get("fmu", ""),
        folder=table.get("folder", ""),
        time_limit=float(table.get("time_limit_s", LawChoice().time_limit)),
        parameters={key: value for key, value in table.items() if key not in KEYS},
    )


def with_law_folders(scenario: ScenarioModel, folder: Path) -> ScenarioModel:
    """Return the scenario with the folder of each law that stands beside its file: processes may start elsewhere."""
    cases = {name: replace(case, law=_placed(case.law, folder)) for name, case in scenario.cases.items()}
    return replace(scenario, law=_placed(scenario.law, folder), cases=cases)


def check_laws(scenario: ScenarioModel, problems: Problems) -> None:
    """Every law is there, takes its parameters, and stands alone."""
    _check("law", scenario.law, problems)
    for name, case in scenario.cases.items():
        path = f"case.{name}.law"
        if case.law != "":  # an empty table is no law, and not the scenario's either
            _check(path, case.law, problems)
        if problems.touch(path, "law"):
            continue
        law = law_of(scenario, name)
        if law.name != PAPER and case.gains not in (scenario.gains, Gains()):
            text = f'[gains] are those of the law "{PAPER}", and this case has {law.name}; write them into [{path}]'
            problems.add(f"case.{name}.gains", text)
        if law.name != PAPER and case.handling.weights != "paper":
            text = f'weights other than "paper" are the law "{PAPER}"\'s, and this case has {law.name}; leave them out'
            problems.add(f"case.{name}.handling.weights", text)


def _placed(law: LawKey, folder: Path) -> LawKey:
    """A law as it is written, with the folder in which its module, program or FMU is looked for."""
    table = table_of(law)
    use = LAWS.reference(str(table.get("use", "")))  # a decorator's name is known to this process alone
    local = ":" in use or "command" in table or "fmu" in table
    if not law or not local or not isinstance(table.get("folder", ""), str) or is_no_path(table.get("folder", "")):
        return law
    place = str((folder / table.get("folder", "")).resolve())
    return table | ({"use": use, "folder": folder_of(use, place)} if ":" in use else {"folder": place})


def _check(path: str, law: LawKey, problems: Problems) -> None:
    table = table_of(law)
    if problems.touch(path):
        return
    given = [key for key in CARRIERS if key in table]
    if len(given) != 1:
        text = f"needs one of use, command, fmu; got {' and '.join(given) or 'none'}"
        problems.add(path, f'{text}; e.g. law = "mine:Mine" or law = {{ command = ["./mylaw"] }}')
        return
    wrong = _wrong_values(table)
    for key, text in wrong.items():
        problems.add(f"{path}.{key}", text)
    if wrong.keys() & {*CARRIERS, "folder"}:  # there is no law to ask
        return
    parameters = {key: value for key, value in table.items() if key not in (*KEYS, *wrong)}
    checks = {"use": _check_class, "command": _check_program, "fmu": _check_fmu}
    for key, text in checks[given[0]](table, parameters):
        problems.add(f"{path}.{key}" if isinstance(law, Mapping) else path, text)


def _wrong_values(table: Mapping[str, Any]) -> dict[str, str]:
    """Return what is wrong whatever carries the law, by key."""
    wrong = {
        key: "must be a text in quotes" for key in ("use", "fmu", "folder") if not isinstance(table.get(key, ""), str)
    }
    wrong |= {
        key: "can be no name of a module, folder or file"
        for key in ("use", "fmu", "folder")
        if key not in wrong and is_no_path(table.get(key, ""))
    }
    command = table.get("command", ["-"])
    if not (isinstance(command, list | tuple) and command and all(isinstance(word, str) for word in command)):
        wrong["command"] = 'must be a list of texts, the program first, e.g. ["./mylaw", "--fast"]'
    elif is_no_path(command[0]):
        wrong["command"] = "begins with what can be no name of a program"
    elif not all(word.isprintable() or word.isascii() for word in command):
        wrong["command"] = "has a character in it that is no text"
    if text := _limit_problem(table.get("time_limit_s", 1.0)):
        wrong["time_limit_s"] = text
    for key, value in table.items():
        if key not in KEYS and (text := scalar_objection(value)):
            wrong[key] = text
    return wrong


def _limit_problem(given: Any) -> str:
    return TIME_LIMIT.objection(given, "s")


def _check_class(table: Mapping[str, Any], parameters: Mapping[str, Any]) -> Sequence[tuple[str, str]]:
    use = table["use"]
    if use == PAPER:
        text = f'the parameters of "{PAPER}" are those of [gains] and [handling]; write them there'
        return [(key, text) for key in parameters]
    try:
        law = LAWS.resolve(use, table.get("folder", ""))
    except PluginError as error:
        return [("use", str(error))]
    wrong = read_parameters(law, parameters)[1]
    if wrong:
        return wrong
    limit = table.get("time_limit_s", LawChoice().time_limit)
    limit = LawChoice().time_limit if _limit_problem(limit) else limit
    try:
        failed = make_limited(law, parameters, limit).close_failure()
    except ValueError as error:
        return [("use", f"{use} {error}")]
    return [("use", f"the close of {use} failed: {failed}")] if failed else []


def _check_program(table: Mapping[str, Any], parameters: Mapping[str, Any]) -> Sequence[tuple[str, str]]:
    program, folder = table["command"][0], Path(table.get("folder", ""))
    if any("\0" in word for word in table["command"]):
        return [("command", "has the character 0 in it, which no command can have")]
    if not folder.is_dir():
        return [("folder", f"there is no folder {folder}")]
    place = folder / program
    if found := shutil.which(str(place.resolve())) or ("/" not in program and shutil.which(program)):
        if text := executable_problem(Path(found)):
            return [("command", f"{program} {text}")]
        return read_parameters(Law, limits_in(parameters))[1]
    if place.is_file():
        return [("command", f"{program} cannot be executed; chmod +x it, or name its interpreter first")]
    return [("command", f"there is no program {program}, neither beside the scenario nor on the PATH")]


def _check_fmu(table: Mapping[str, Any], parameters: Mapping[str, Any]) -> Sequence[tuple[str, str]]:
    from agents.carriers.fmu import load_problem
    from agents.carriers.fmu_interface import fmu_problems

    path = Path(table.get("folder", "")) / table["fmu"]
    wrong = fmu_problems(path, parameters)
    if not wrong and (text := load_problem(path)):
        wrong = [("fmu", text)]
    return wrong
