"""The command `gridpeers why`. What it needs is imported when it is used, so that help comes at once."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, require, terminal


def why(
    run: Annotated[
        Path, typer.Argument(metavar="RUN", help="Folder of a case, e.g. runs/islanding/latest/IV, or its run.mcap.")
    ],
    agent: Annotated[str, typer.Argument(metavar="AGENT", help="Name of the inverter, e.g. inv4.")],
    t: Annotated[float, typer.Argument(metavar="TIME", help="Run time (s): the decision in force then is explained.")],
    case: Annotated[str, typer.Option(metavar="NAME", help="Case of the run, if RUN has several.")] = "",
    follow: Annotated[
        bool, typer.Option("--follow", help="Follow both set-points back over neighbours, by the largest terms.")
    ] = False,
    hops: Annotated[int, typer.Option(metavar="N", min=1, max=1000, help="Most decisions to follow back.")] = 8,
) -> None:
    """Explain why an agent decided as it did.

    That is what it measured, whom it heard and whom not and why, each term of its law, and the limits, from the record
    of the run. docs/why.md has examples.

    Exit code: 0 it was explained, 2 bad usage, no record, or nothing in it for this agent and time.

    Example:  gridpeers why runs/islanding/latest/IV inv4 4.3
    """
    require({"mcap": "the record of a run"})

    from gridpeers.lab.explanation.explanation import explain, trail
    from gridpeers.lab.explanation.explanation_text import show
    from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord

    if not isfinite(t):
        fail([f"TIME {t}: needs a run time in s, as 4.3"], BAD_INPUT)
    try:
        record = RunRecord.open(run, case)
        explanation = explain(record, agent, t)
        trails = [(name, trail(record, explanation.decision, name, hops)) for name in ("P_set", "V_set") if follow]
    except RecordFileError as error:
        fail([str(error)], BAD_INPUT)
    show(explanation, terminal(), trails)  # type: ignore[arg-type]  # the names are those of a trail
