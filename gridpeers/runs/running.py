"""Run a scenario from Python: the same body as the command's, into a folder that lives as long as its results."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from gridpeers.runs.choices import check_how, with_cases
from gridpeers.runs.result import Results
from gridpeers.runs.run_folder import RunFolder, empty_folder
from scenarios.results.numbers import Clock
from scenarios.run import BrokenRunError, Driver, Progress, Request
from scenarios.run import run as run_request
from scenarios.spec import ScenarioError
from scenarios.spec.portability import check_portable

if TYPE_CHECKING:
    from gridpeers.scenario import Scenario


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
        home = RunFolder(empty_folder(folder))
    request = Request(
        scenario=spec,
        feeder=scenario.feeder,
        driver=driver,
        folder=home.path,
        clock=clock,
        speed=speed,
        strict=strict,
        lasting=folder is not None,
    )
    try:
        run_request(request, progress or _silent)
    except BrokenRunError as error:
        home.keep()
        raise BrokenRunError(f"{error}; what came until then is in {home.path}") from error
    return Results(home, spec, scenario.feeder)


def _silent(case: str, t: float, end: float) -> None:
    """Show no progress."""
