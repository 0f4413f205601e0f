"""Run a scenario from Python: the same body as the command's, into a folder that lives as long as its results."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from gridpeers.runs.choices import Pace, check_how, with_cases
from gridpeers.runs.result import Results
from gridpeers.runs.run_folder import RunFolder, empty_folder
from scenarios.results.run_files import FolderError
from scenarios.run import BrokenRunError, Driver, Progress, Request
from scenarios.run import run as run_request
from scenarios.spec import ScenarioError
from scenarios.spec.portability import check_portable
from wire.suggestion import suggestion

if TYPE_CHECKING:
    from gridpeers.scenario import Scenario


class How(Pace, total=False):
    """How a run goes, beside its driver; `gridpeers.Scenario.run` says what the words mean."""

    progress: Progress | None
    folder: str | Path | None


def run(
    scenario: Scenario,
    cases: Iterable[str] | None,
    driver: Driver,
    *,
    progress: Progress | None = None,
    folder: str | Path | None = None,
    **pace: Unpack[Pace],
) -> Results:
    """Run some cases of a scenario, or all, into a folder of their own; see `gridpeers.Scenario.run`."""
    words = How.__annotations__
    for name in pace:
        if name not in words:
            raise TypeError(f'run has no argument "{name}"; {suggestion(name, words, "arguments")}')
    spec = with_cases(scenario.spec, cases)
    check_how(driver, pace)
    if progress is not None and not callable(progress):
        raise ScenarioError([f"progress: must be a function of a case and two times, got {progress!r:.60}"])
    if driver == "processes" and (wrong := check_portable(spec)):
        raise ScenarioError(wrong)
    if folder is None:
        try:
            home = RunFolder(Path(tempfile.mkdtemp(prefix="gridpeers-")), temporary=True)
        except OSError as error:
            text = f"there is nowhere for temporary files: {error.strerror}; say folder=..., or set TMPDIR"
            raise FolderError(text) from error
    else:
        home = RunFolder(empty_folder(folder))
    request = Request(
        scenario=spec,
        feeder=scenario.feeder,
        driver=driver,
        folder=home.path,
        lasting=folder is not None,
        **pace,
    )
    try:
        run_request(request, progress or _silent)
    except BrokenRunError as error:
        home.keep()
        raise BrokenRunError(f"{error}; what came until then is in {home.path}") from error
    return Results(home, spec, scenario.feeder)


def _silent(case: str, t: float, end: float) -> None:
    """Show no progress."""
