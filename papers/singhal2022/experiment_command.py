"""`gridpeers experiment`: from a name to a figure and a table. The experiments are imported when one is run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import gridpeers as gp
from gridpeers.cli.commands.sweep_command import failure_lines, finish, read
from gridpeers.cli.progress import progress
from gridpeers.cli.usage import (
    BROKEN,
    CLAIM_FAILED,
    FigureFormat,
    argument,
    check_choice,
    ended_by_signals,
    fail,
    option,
    terminal,
)
from gridpeers.output_folders import RUNS, refusal, shown

if TYPE_CHECKING:
    from gridpeers.papers.singhal2022.experiments import Experiment
    from gridpeers.papers.singhal2022.experiments.experiment_output import ExperimentResult


def experiment(
    name: Annotated[str, argument("NAME", "Name of an experiment; `list` shows all.")] = "list",
    out: Annotated[
        Path | None, option("DIR", "Folder, new or begun by this experiment; runs/experiments/NAME if left out.")
    ] = None,
    figures: FigureFormat = "png",
    jobs: Annotated[int | None, option("N", "Parallel processes; one per core if left out.", min=1)] = None,
) -> None:
    """Run an experiment on late, lossy or broken links.

    It writes a figure and a table that compare the runs with theory. The same command resumes an interrupted sweep.
    docs/understand/findings.md has the findings.

    Example:  gridpeers experiment delay
    """
    from gridpeers.papers.singhal2022.experiments import EXPERIMENTS

    if name == "list":
        for known, source in EXPERIMENTS.items():
            title = gp.sweep_files.sweep_title(source.sweep) if source.sweep else gp.load(source.scenario).title
            typer.echo(f"{known:22} {title}")
        return
    check_choice("", "experiment", name, tuple(EXPERIMENTS))
    source, folder = EXPERIMENTS[name], RUNS / "experiments" / name if out is None else out
    again = ["experiment", name, *(["--out", str(out)] if out else [])]
    result = _from_sweep(source, folder, jobs, again) if source.sweep else _from_scenario(source, folder)
    try:
        files = result.write(folder, figures)
    except OSError as error:
        fail(refusal(folder, error), code=BROKEN)
    for path in files:
        typer.echo(shown(path))


def _from_sweep(source: Experiment, folder: Path, jobs: int | None, again: Sequence[str]) -> ExperimentResult:
    """Do the runs of the sweep that are not done yet, and draw."""
    import pandas as pd

    from gridpeers.papers.singhal2022.experiments.experiment_data import SweepData

    plan = read(source.sweep)
    summary = finish(source.sweep, plan, folder, jobs, again)
    if summary.law_failed:
        fail(*failure_lines(summary), code=CLAIM_FAILED)
    if summary.broke:
        fail(*[f"{count} runs broke: {why}" for why, count in summary.broke.items()], code=BROKEN)
    rows = pd.read_csv(summary.table, float_precision="round_trip")
    return source.make(SweepData(rows=rows, base=plan.base, window=plan.base.events[0].label))


def _from_scenario(source: Experiment, folder: Path) -> ExperimentResult:
    """Run every case of the scenario in this process, and draw."""
    from gridpeers.papers.singhal2022.experiments.experiment_data import CaseData

    scenario, left = gp.load(source.scenario), f"what came until then is in {shown(folder)}/"
    try:
        with ended_by_signals(left), progress(terminal(), tuple(scenario.cases)) as tell:
            run = scenario.run(progress=tell, folder=folder)
    except gp.BrokenRunError as error:
        fail(f"the run broke: {error}", code=BROKEN)
    if len(run.failures):
        fail(*[f"FAILED  {why}" for why in run.failures["why"]], code=CLAIM_FAILED)
    histories = {case: result.record for case, result in run.items()}
    return source.make(CaseData(scenario=scenario.spec, feeder=scenario.feeder, histories=histories))
