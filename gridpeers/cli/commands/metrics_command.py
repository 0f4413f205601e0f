"""The command `gridpeers metrics`. What it needs is imported when it is used, so that help comes at once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, require, terminal


def metrics(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="Folder of a case, e.g. runs/islanding/latest/IV, or its run.mcap.")
    ],
    case: Annotated[str, typer.Option(metavar="NAME", help="Case of the run, if RUN has several.")] = "",
) -> None:
    """Measure a run from its record, also one that was killed.

    It shows what the report of a run shows, up to the end of the record, and says what is not measured. A run that came
    to its end has the same numbers in its report.txt.

    Exit code: 0 it was measured, 2 bad usage, no record, or nothing in it that can be measured.

    Example:  gridpeers metrics runs/islanding/latest/IV
    """
    require({"mcap": "the record of a run"})

    from gridpeers.scenarios.record.record_metrics import report_of
    from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
    from gridpeers.scenarios.results.report import show

    try:
        report = report_of(RunRecord.open(run, case))
    except RecordFileError as error:
        fail([str(error)], BAD_INPUT)
    show(report, terminal())
