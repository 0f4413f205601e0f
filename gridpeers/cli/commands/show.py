"""The commands `list`, `check`, `doc`, `compare` and `export`; each imports its modules when it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from gridpeers.cli.usage import FigureFormat, argument, fail, option, require
from gridpeers.wire.wording import printable

Topic = Literal[
    "keys", "messages", "scenario", "feeder", "laws", "inverters", "metrics", "claims", "checks", "faults", "graphs"
]


def list_() -> None:
    """List the scenarios that come with gridpeers.

    Example:  gridpeers list
    """
    from gridpeers.scenarios.catalogue_files import summaries

    scenarios = summaries()
    width = max(map(len, scenarios), default=0)
    for name, (title, cases) in scenarios.items():
        typer.echo(f"{name:{width}}  {title}. Cases: {', '.join(cases)}")


def check(file: Annotated[str, argument("FILE", "A name that `gridpeers list` shows, or the path of a file.")]) -> None:
    """Check a scenario file and its feeder for problems.

    It lists all problems at once. If there is none, it solves the operating point of the feeder at the start. Notes
    name buses that an event de-energises, and graphs with too few links for a law that resists liars.

    Example:  gridpeers check my-islanding.toml
    """
    from gridpeers.cli.progress import TRYING, explained
    from gridpeers.scenario import load

    scenario = load(file)
    with explained(lambda: typer.echo(TRYING)):
        notes = scenario.check()
    for note in notes:
        typer.echo(f"NOTE  {note}")
    typer.echo(f"{file}: can be run: {scenario.extent}")


def doc(topic: Annotated[Topic, argument("TOPIC", "Topic of the page.")]) -> None:
    """Print a reference page that is made from the code.

    keys and messages describe the protocol, scenario the keys of a scenario file, and feeder the tables of a feeder.
    The other topics list the plug-ins, yours too, with their parameters.

    Example:  gridpeers doc scenario
    """
    from gridpeers.scenarios.reference import page

    typer.echo(page(topic), nl=False)


_Run = Annotated[Path, argument("RUN", "Folder of a run, e.g. runs/islanding/latest.")]


def compare(
    first: _Run,
    second: _Run,
    out: Annotated[
        Path | None, option("FILE", "Figure, as .png, .pdf or .svg; runs/comparison.png if left out.")
    ] = None,
    figures: FigureFormat = "png",
) -> None:
    """Compare two runs: scenarios, metrics, and one figure of both.

    Example:  gridpeers compare runs/islanding/latest runs/mine/latest
    """
    kinds, out = (".png", ".pdf", ".svg"), out or Path(f"runs/comparison.{figures}")
    if out.suffix not in kinds:
        fail(f"--out {out}: must end in {', '.join(kinds)}")

    from gridpeers.output_folders import files_written, shown
    from gridpeers.runs.comparison import compare as compare_runs

    # folders of runs are named by the time, their parents by the scenario
    a, b = (printable(path.resolve().parent.name) for path in (first, second))
    comparison = compare_runs(first, second, names=(a, b) if a != b else ("first", "second"))
    typer.echo(str(comparison))
    with files_written(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        comparison.plot().savefig(out)
    typer.echo(f"\nFigure: {shown(out)}")


def export(
    run: Annotated[Path, argument("RUN", "Folder of a run or of a case, e.g. runs/islanding/latest.")],
    to: Annotated[
        Literal["csv", "parquet", "feather", "mat", "xlsx"], typer.Option(help="Format: text, Arrow, MATLAB or Excel.")
    ] = "csv",
    case: Annotated[str, option("NAME", "Case of the run; all if left out.")] = "",
    out: Annotated[Path | None, option("DIR", "Folder for the files; beside each record if left out.")] = None,
) -> None:
    """Write a run's tables as CSV, Parquet, MATLAB or Excel files.

    The tables come from the record run.mcap. If the run was killed or still goes on, a note says where they end. csv,
    parquet and feather write a file for each table; mat and xlsx write one file. Files of the same name are replaced.

    Exit code: 0 if written; 2 for wrong options, no record, no rows, or a folder that cannot be written.

    Example:  gridpeers export runs/islanding/latest --to parquet
    """
    from gridpeers.output_folders import files_written, shown
    from gridpeers.runs.export import PACKAGES
    from gridpeers.runs.export import export as export_record
    from gridpeers.scenarios.record.record_file import records_in
    from gridpeers.scenarios.record.record_reader import RunRecord

    if to in PACKAGES:
        require({PACKAGES[to]: f"--to {to}"}, "export")
    files = records_in(run, case)
    with files_written(out or run):
        for file in files:
            record = RunRecord.open(file)
            folder = file.parent if out is None else out / file.parent.name if len(files) > 1 else out
            folder.mkdir(parents=True, exist_ok=True)
            for written in export_record(record, to, folder):
                typer.echo(shown(written))
            for damage in record.damage:
                typer.echo(f"NOTE  {shown(file)}: {damage}")
