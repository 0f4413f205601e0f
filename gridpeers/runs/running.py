"""Run a scenario from Python, or open a run folder: both give `Results`."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from gridpeers.plant.tables import read_feeder
from gridpeers.runs.choices import Pace, check_how, with_cases
from gridpeers.runs.result import Result, Results
from gridpeers.runs.run_folder import RunFolder, as_folder, new_home
from gridpeers.scenarios.results.recorded_events import first_of
from gridpeers.scenarios.results.run_files import FolderError, is_complete
from gridpeers.scenarios.run import run as run_request
from gridpeers.scenarios.run_request import BrokenRunError, Driver, Progress, Request
from gridpeers.scenarios.schema import ScenarioError
from gridpeers.scenarios.schema.configs import as_in
from gridpeers.scenarios.schema.loading import read_tables, read_toml
from gridpeers.scenarios.schema.plugin_keys import check_portable
from gridpeers.scenarios.schema.scenario_errors import Problems

if TYPE_CHECKING:
    from gridpeers.scenario import Scenario


class How(Pace, total=False):
    """Options of a run beside its driver, as in `gridpeers.Scenario.run`."""

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
    spec = with_cases(scenario.spec, cases)
    check_how(driver, pace, spec)
    if driver == "processes" and (wrong := check_portable(spec)):
        raise ScenarioError(wrong)
    if folder is not None:
        home = RunFolder(new_home(folder))
    else:
        try:
            home = RunFolder(Path(tempfile.mkdtemp(prefix="gridpeers-")), temporary=True)
        except OSError as error:
            text = f"no place for temporary files: {error.strerror}; give folder=..., or set TMPDIR"
            raise FolderError(text) from error
    lasting = folder is not None
    request = Request(scenario=spec, feeder=scenario.feeder, driver=driver, folder=home.path, lasting=lasting, **pace)
    try:
        report = run_request(request, progress or (lambda case, t, end: None))
    except BrokenRunError as error:
        home.keep()
        raise type(error)(f"{error}; the files up to then are in {home.path}") from error
    warn_of_laws({case: first_of(failures) for case, failures in report.failures.items()}, depth=2)
    return Results(home, spec, scenario.feeder)


def warn_of_laws(failed: Mapping[str, str], depth: int) -> None:
    """Warn once of laws that failed, given by case or run, at the line of the user: so many calls above the caller."""
    if lines := [f"{where}: {why}" for where, why in failed.items() if why]:
        more = f" (and in {len(lines) - 1} more)" if len(lines) > 1 else ""
        warnings.warn(f"a law failed, {lines[0]}{more}", RuntimeWarning, stacklevel=depth + 2)


def read(folder: str | Path) -> Result | Results:
    """Open a run folder that `Result.save`, `gridpeers run` or `gridpeers up` wrote.

    Return a `Result` if the run has one case, else `Results`. Raise FolderError if the folder has no finished run.
    """
    path = as_folder(folder)
    if not (path / "status.txt").is_file():
        hint = f"; {path / 'latest'} is one" if (path / "latest" / "status.txt").is_file() else ""
        raise FolderError(f"{folder}: not a run folder, because it has no status.txt{hint}")
    status = (path / "status.txt").read_text(encoding="utf-8", errors="replace").strip()
    if not is_complete(status):
        raise FolderError(f'{folder}: the run has no results; its status is "{status}"')
    try:
        text, tables = read_toml(path / "scenario.toml")
        problems = Problems(str(path / "scenario.toml"), text)
        spec = read_tables(tables, problems)  # not checked further: to read a run needs no law, and no path of old
        problems.raise_if_any()
        feeder = as_in(spec, read_feeder(spec.plant.feeder, spec.plant.load_set))
        results = Results(RunFolder(path.absolute()), spec, feeder)
    except (OSError, ValueError, KeyError) as error:
        text = "; ".join(getattr(error, "problems", ())) or str(error)
        raise FolderError(f"{folder}: cannot be read: {text}") from error
    return next(iter(results.values())) if len(results) == 1 else results
