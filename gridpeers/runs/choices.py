"""Options of a run: cases, driver, clock. Their check imports nothing that a run needs: commands make it first."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TypedDict, get_args

import msgspec

from gridpeers.scenarios.results.metrics_file import Clock
from gridpeers.scenarios.run_request import SPEEDS, Driver
from gridpeers.scenarios.schema import ScenarioError
from gridpeers.scenarios.schema import scenario_model as model
from gridpeers.wire.wording import suggestion


def with_cases(spec: model.ScenarioModel, names: Iterable[str] | None, *, option: str = "") -> model.ScenarioModel:
    """Return a scenario with some of its cases; all if none is named.

    An `option` of the command line heads every problem.

    Raises
    ------
    ScenarioError
        If there is no such case.

    Examples
    --------
    >>> from gridpeers.scenarios.schema import load_scenario
    >>> list(with_cases(load_scenario("islanding")[0], ["IV", "I"]).cases)
    ['I', 'IV']
    """
    if names is None:
        return spec
    if not isinstance(names, Iterable):
        raise ScenarioError([f"{option}cases: needs a name, a list of names, or None for all, got {names!r:.60}"])
    chosen = list(names)
    unknown = [name for name in chosen if not isinstance(name, str) or name not in spec.cases] if chosen else [""]
    if unknown:
        raise ScenarioError(
            f'{option}no case "{name}"; {suggestion(str(name), spec.cases, "cases")}' for name in unknown
        )
    return msgspec.structs.replace(spec, cases={name: rule for name, rule in spec.cases.items() if name in chosen})


class Pace(TypedDict, total=False):
    """Time and processes of a run: fields of a `Request`, options of the command, arguments of `Scenario.run`."""

    clock: Clock
    speed: float
    strict: bool
    processes: int
    keys: str | Path | None


def check_how(driver: str, pace: Pace, spec: model.ScenarioModel, *, dash: str = "") -> None:
    """Check the options of a scenario's run; `dash` stands before their names: "--" on a command line.

    Raises
    ------
    ScenarioError
        If there is no such driver or clock, or they do not go together.
    """
    clock, speed, strict = pace.get("clock", "simulated"), pace.get("speed", 1.0), pace.get("strict", False)
    for word, value, choices in (("driver", driver, get_args(Driver)), ("clock", clock, get_args(Clock))):
        if not isinstance(value, str) or value not in choices:
            raise ScenarioError([f'{dash}{word}: there is no "{value}"; {suggestion(str(value), choices, "choices")}'])
    low, high = SPEEDS
    wrong = ""
    processes = pace.get("processes", 0)
    if not isinstance(processes, int) or processes < 0:
        raise ScenarioError(
            [f"{dash}processes: must be a number of processes from 1, or 0 for one an agent, got {processes!r}"]
        )
    if processes and driver == "inprocess":
        raise ScenarioError([f"{dash}processes: needs {dash}driver processes; in one process all agents share it"])
    keys = pace.get("keys")
    if keys is not None and not isinstance(keys, str | Path):
        raise ScenarioError([f"{dash}keys: must be the path of a folder with certificates, got {keys!r:.60}"])
    if keys is not None and driver == "inprocess":
        raise ScenarioError([f"{dash}keys: needs {dash}driver processes; in one process there is no link to secure"])
    if keys is not None and processes:
        raise ScenarioError(
            [f"{dash}processes: agents of one process have one certificate; leave it out with {dash}keys"]
        )
    if keys is None and driver == "processes" and spec.security == "mtls":
        raise ScenarioError([model.NEEDS_KEYS])
    if clock == "simulated":
        if speed != 1.0 or strict:
            name = "strict" if strict else "speed"
            wrong = f"{dash}{name}: simulated time has no pace to keep; use it with {dash}clock wall"
    elif spec.plant.simulator != "gridpeers":
        wrong = f'{dash}clock wall: the plant of "{spec.plant.simulator}" keeps no real time; use {dash}clock simulated'
    elif driver == "inprocess":
        wrong = f"{dash}clock wall: needs a process per agent; use {dash}driver processes"
    elif not (isinstance(speed, int | float) and low <= speed <= high):
        got = f"{speed:g}" if isinstance(speed, int | float) else repr(speed)
        wrong = f"{dash}speed: must be from {low:g} to {high:g} (1 is real time), got {got}"
    if spec.plant.simulator == "helics" and len(spec.cases) > 1:
        names = ", ".join(spec.cases)
        wrong = f"{dash}case: a HELICS federation runs once, so choose one case of {names}"
    if wrong:
        raise ScenarioError([wrong])
