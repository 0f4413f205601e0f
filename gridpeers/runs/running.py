"""Run a scenario from Python: the same body as the command's, into a folder that lives as long as its results."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict, get_args

import msgspec

from gridpeers.runs.result import Results
from gridpeers.runs.run_folder import RunFolder, empty_folder
from scenarios.results.numbers import Clock
from scenarios.run import BrokenRunError, Driver, Progress, Request
from scenarios.run import run as run_request
from scenarios.spec import ScenarioError, model
from scenarios.spec.portability import check_portable
from wire.nearest import suggestion

if TYPE_CHECKING:
    from gridpeers.scenario import Scenario

SPEEDS = (0.1, 50.0)
"""Least and greatest speed of a run in real time."""


class How(TypedDict, total=False):
    """How a run goes, beside its driver; `gridpeers.Scenario.run` says what the words mean."""

    clock: Clock
    speed: float
    strict: bool
    progress: Progress | None
    folder: str | Path | None


def run(
    scenario: Scenario,
    cases: Iterable[str] | None,
    driver: Driver,
    *,
    clock: Clock = "simulated",
    speed: float = 1.0,
    strict: bool = False,
    progress: Progress | None = None,
    folder: str | Path | None = None,
) -> Results:
    """Run some cases of a scenario, or all, into a folder of their own; see `gridpeers.Scenario.run`."""
    spec = with_cases(scenario.spec, cases)
    check_how(driver, clock, speed, strict=strict)
    if driver == "processes" and (wrong := check_portable(spec)):
        raise ScenarioError(wrong)
    if folder is None:
        home = RunFolder(Path(tempfile.mkdtemp(prefix="gridpeers-")), temporary=True)
    else:
        home = RunFolder(empty_folder(Path(folder)))
    request = Request(
        scenario=spec,
        feeder=scenario.feeder,
        driver=driver,
        folder=home.path,
        clock=clock,
        speed=speed,
        strict=strict,
        figures=folder is not None,
    )
    try:
        run_request(request, progress or _silent)
    except BrokenRunError as error:
        home.keep()
        raise BrokenRunError(f"{error}; what came until then is in {home.path}") from error
    return Results(home, spec, scenario.feeder)


def with_cases(spec: model.Scenario, names: Iterable[str] | None, *, option: str = "") -> model.Scenario:
    """Return a scenario with some of its cases; all if none is named.

    An `option` of the command line heads every mistake.

    Raises
    ------
    ScenarioError
        If there is no such case.

    Examples
    --------
    >>> from scenarios.spec import load_scenario
    >>> list(with_cases(load_scenario("islanding")[0], ["IV", "I"]).cases)
    ['I', 'IV']
    """
    if names is None:
        return spec
    chosen = list(names)
    unknown = [name for name in chosen if name not in spec.cases] if chosen else [""]
    if unknown:
        raise ScenarioError(f'{option}no case "{name}"; {suggestion(name, spec.cases, "cases")}' for name in unknown)
    return msgspec.structs.replace(spec, cases={name: rule for name, rule in spec.cases.items() if name in chosen})


def check_how(driver: str, clock: str, speed: float, *, strict: bool, dash: str = "") -> None:
    """Check how a scenario is to be run; `dash` stands before the words' names: "--" on a command line.

    Raises
    ------
    ScenarioError
        If there is no such driver or clock, or they do not go together.
    """
    for word, value, choices in (("driver", driver, get_args(Driver)), ("clock", clock, get_args(Clock))):
        if value not in choices:
            raise ScenarioError([f'{dash}{word}: there is no "{value}"; {suggestion(str(value), choices, "choices")}'])
    low, high = SPEEDS
    wrong = ""
    if clock == "simulated":
        if speed != 1.0 or strict:
            name = "strict" if strict else "speed"
            wrong = f"{dash}{name}: simulated time has no pace to keep; use it with {dash}clock wall"
    elif driver == "inprocess":
        wrong = f"{dash}clock wall: needs a process per agent; use {dash}driver processes"
    elif not (isinstance(speed, int | float) and low <= speed <= high):
        got = f"{speed:g}" if isinstance(speed, int | float) else repr(speed)
        wrong = f"{dash}speed: must be from {low:g} to {high:g} (1 is real time), got {got}"
    if wrong:
        raise ScenarioError([wrong])


def _silent(case: str, t: float, end: float) -> None:
    """Show no progress."""
