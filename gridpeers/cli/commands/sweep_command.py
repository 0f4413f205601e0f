"""The command `gridpeers sweep`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gridpeers.cli.progress import remaining
from gridpeers.cli.usage import (
    BROKEN,
    CLAIM_FAILED,
    PASSED,
    argument,
    exit_code,
    fail,
    flag,
    interruptible,
    option,
    require,
    terminal,
)
from gridpeers.output_folders import refusal, shown
from gridpeers.scenarios.sweep.sweep_reading import Plan, read_sweep
from gridpeers.scenarios.sweep.workers import WorkersError, cores
from gridpeers.wire.driver.command_line import command_line

if TYPE_CHECKING:
    from gridpeers.scenarios.sweep.study import Summary


def sweep(
    file: Annotated[str, argument("FILE", "Path of a sweep file, or a name such as gains or topology.")],
    out: Annotated[
        Path | None, option("DIR", "Folder, new or begun by this sweep; runs/sweeps/NAME if left out.")
    ] = None,
    jobs: Annotated[int | None, option("N", "Parallel processes; one per core if left out.", min=1)] = None,
    dry_run: Annotated[bool, flag("Check all runs, print their number, and start none.", "--dry-run")] = False,
) -> None:
    """Run a scenario many times over values of its keys.

    The result is one table. The same command resumes an interrupted sweep.

    Example:  gridpeers sweep topology --jobs 2
    """
    plan = read(file)
    if dry_run:
        typer.echo(_size(file, plan))
        return
    from gridpeers.scenarios.sweep.study import folder_of

    again = ["sweep", file, *(["--out", str(out)] if out else [])]
    summary = finish(file, plan, folder_of(out, plan.name), jobs, again)
    for line in failure_lines(summary):
        typer.secho(line, fg="red", bold=True)
    broke = sum(summary.broke.values())
    ended = f"{summary.runs - broke - sum(summary.law_failed.values())} runs reached their end"
    typer.echo(f"{ended}, {broke} broke:" if broke else ended)
    for why, count in summary.broke.most_common(3):
        typer.echo(f"  {count} x {why}")
    if len(summary.broke) > 3:
        typer.echo(f"  and {len(summary.broke) - 3} more reasons in the column why")
    typer.echo(f"table: {shown(summary.table)}")
    raise typer.Exit(BROKEN if broke == summary.runs else CLAIM_FAILED if summary.law_failed else PASSED)


def read(file: str) -> Plan:
    """Return the plan of a sweep; end with what to install if its runs need more."""
    plan = read_sweep(file)
    require({"joblib": "the runs over all cores"}, "sweep")
    return plan


def finish(file: str, plan: Plan, path: Path, jobs: int | None, again: Sequence[str]) -> Summary:
    """Run the rest of a sweep and show its progress; an error ends the command.

    `again` has the words of the command that resumes it.
    """
    from gridpeers.scenarios.sweep.study import SweepFolder, study

    console = terminal()
    with interruptible(), SweepFolder(path, plan) as folder:
        console.print(_size(file, plan, len(folder.done)), soft_wrap=True)
        try:
            with remaining(console, size := len(plan.runs)) as tell:
                return study(
                    plan, folder, lambda done: tell(f"{plan.name}, {done} of {size} runs", done), jobs=jobs or cores()
                )
        except (KeyboardInterrupt, OSError, WorkersError) as error:
            kept = f"{folder.kept} of {size} runs are kept in {shown(path)}/; continue with: {command_line(*again)}"
            if isinstance(error, KeyboardInterrupt):
                fail(f"interrupted; {kept}", code=exit_code(error))
            fail(refusal(path, error) if isinstance(error, OSError) else str(error), kept, code=BROKEN)


def failure_lines(summary: Summary) -> list[str]:
    """Return a line for each of the first laws that failed."""
    return [f"FAILED  {count} x {why}" for why, count in summary.law_failed.most_common(3)]


def _size(file: str, plan: Plan, done: int = 0) -> str:
    samples = plan.runs[-1].sample + 1
    left = f"; {done} are done already" if done else ""
    varied = ", ".join(plan.parameters)
    return f"{file}: {len(plan.runs)} runs ({samples} samples of {plan.base.name}) over {varied}{left}"
