"""Options of a run: cases, driver, clock, and their check, which imports no part of a run."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TypedDict, get_args

import msgspec

from gridpeers.plant.simulators import SIMULATORS
from gridpeers.scenarios.run_request import SPEEDS, Clock, Driver
from gridpeers.scenarios.schema import ScenarioError
from gridpeers.scenarios.schema import scenario_model as model
from gridpeers.wire.driver.machine import POSIX
from gridpeers.wire.wording import suggestion


def with_cases(spec: model.ScenarioModel, names: Iterable[str] | None, *, option: str = "") -> model.ScenarioModel:
    """Return a scenario with some of its cases, in its order; None keeps all. `option` precedes each problem."""
    if names is None:
        return spec
    chosen = list(names)
    unknown = [name for name in chosen if name not in spec.cases] if chosen else [""]
    if unknown:
        raise ScenarioError(
            f'{option}no case "{name}"; {suggestion(str(name), spec.cases, "cases")}' for name in unknown
        )
    return msgspec.structs.replace(spec, cases={name: rule for name, rule in spec.cases.items() if name in chosen})


class Pace(TypedDict, total=False):
    """Time and processes of a run: fields of a `Request`, options of a command, arguments of `Scenario.run`."""

    clock: Clock
    speed: float
    strict: bool
    processes: int
    keys: str | Path | None


def check_how(driver: str, pace: Pace, spec: model.ScenarioModel, *, dash: str = "") -> None:
    """Check the options of a run; `dash` precedes their names: "--" on a command line."""
    clock, speed, strict = pace.get("clock", "simulated"), pace.get("speed", 1.0), pace.get("strict", False)
    processes, keys, simulator = pace.get("processes", 0), pace.get("keys"), SIMULATORS.resolve(spec.plant.simulator)
    problem = ""
    if str(clock) == "wall":
        raise ScenarioError([f'{dash}clock: "wall" is now called "realtime"; use {dash}clock realtime'])
    for word, value, choices in (("driver", driver, get_args(Driver)), ("clock", clock, get_args(Clock))):
        if value not in choices:
            raise ScenarioError([f'{dash}{word}: there is no "{value}"; {suggestion(value, choices, "choices")}'])
    if driver == "processes" and not POSIX:
        problem = f"driver processes: needs Linux or macOS; use {dash}driver inprocess"
    elif processes < 0:
        problem = f"processes: must be a number of processes from 1, or 0 for one an agent, got {processes}"
    elif processes and driver == "inprocess":
        problem = f"processes: needs {dash}driver processes; in one process all agents share it"
    elif keys is not None and driver == "inprocess":
        problem = f"keys: needs {dash}driver processes; in one process there is no link to secure"
    elif keys is not None and processes:
        problem = f"processes: agents of one process have one certificate; leave it out with {dash}keys"
    elif keys is None and driver == "processes" and spec.security == "mtls":
        raise ScenarioError([model.NEEDS_KEYS])
    elif simulator.elsewhere and len(spec.cases) > 1:
        problem = f"case: {simulator.words} runs once, so choose one case of {', '.join(spec.cases)}"
    elif clock == "simulated" and (speed != 1.0 or strict):
        name = "strict" if strict else "speed"
        problem = f"{name}: simulated time has no pace to keep; use it with {dash}clock realtime"
    elif clock == "realtime" and spec.plant.simulator != "gridpeers":
        problem = (
            f'clock realtime: the plant of "{spec.plant.simulator}" cannot run in real time; use {dash}clock simulated'
        )
    elif clock == "realtime" and driver == "inprocess":
        problem = f"clock realtime: needs a process per agent; use {dash}driver processes"
    elif clock == "realtime" and not SPEEDS[0] <= speed <= SPEEDS[1]:
        problem = f"speed: must be from {SPEEDS[0]:g} to {SPEEDS[1]:g} (1 is real time), got {speed:g}"
    if problem:
        raise ScenarioError([f"{dash}{problem}"])
