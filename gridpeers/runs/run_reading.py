"""Open the folder of a run as its results."""

from __future__ import annotations

from pathlib import Path

from gridpeers.runs.result import Result, Results
from gridpeers.runs.run_folder import RunFolder, as_folder
from plant.tables import read_feeder
from scenarios.results.run_files import FolderError
from scenarios.spec.loading import read_toml
from scenarios.spec.scenario_changes import as_in
from scenarios.spec.scenario_errors import Mistakes
from scenarios.spec.scenario_reading import read_tables


def read(folder: str | Path) -> Result | Results:
    """Open the folder of a run, whoever made it: `Result.save`, `gridpeers run` or `gridpeers up`.

    Returns
    -------
    Result or Results
        A `Result` if the run has one case, else `Results`.

    Raises
    ------
    FolderError
        If it is no folder of a run, or of one that did not come to its end.
    """
    path = as_folder(folder)
    if not (path / "status.txt").is_file():
        hint = f"; {path / 'latest'} is one" if (path / "latest" / "status.txt").is_file() else ""
        raise FolderError(f"{folder}: this is no folder of a run, which has a file status.txt{hint}")
    status = (path / "status.txt").read_text(encoding="utf-8", errors="replace").strip()
    if status != "complete":
        raise FolderError(f'{folder}: the run has no results: its status is "{status}"')
    try:
        text, tables = read_toml(path / "scenario.toml")
        mistakes = Mistakes(str(path / "scenario.toml"), text)
        spec = read_tables(tables, mistakes)  # not checked further: to read a run needs no law, and no path of old
        mistakes.raise_if_any()
        feeder = as_in(spec, read_feeder(spec.plant.feeder, spec.plant.load_set))
        results = Results(RunFolder(path.absolute()), spec, feeder)
    except (OSError, ValueError, KeyError) as error:
        text = "; ".join(getattr(error, "mistakes", ())) or str(error)
        raise FolderError(f"{folder}: cannot be read: {text}") from error
    return next(iter(results.values())) if len(results) == 1 else results
