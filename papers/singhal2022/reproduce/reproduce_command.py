"""The command `gridpeers reproduce`. The experiments and the report are imported when it runs."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import typer

import gridpeers as gp
from gridpeers.cli.progress import remaining
from gridpeers.cli.usage import (
    BROKEN,
    CLAIM_FAILED,
    PASSED,
    check_choice,
    exit_code,
    fail,
    interruptible,
    option,
    terminal,
)
from gridpeers.output_folders import OutputLostError, new_folder, refusal, set_broken, shown


def reproduce(
    driver: Annotated[
        Literal["processes", "inprocess"],
        typer.Option(help="processes: one process per agent, over Zenoh; inprocess: all in one."),
    ] = "processes",
    only: Annotated[
        str | None, option("WHAT", "Part of the report: tables (without figures), figures, or the name of a scenario.")
    ] = None,
    seed: Annotated[
        int | None, option("N", "Seed of all scenarios and random graphs, in place of theirs.", min=0)
    ] = None,
    jobs: Annotated[
        int | None, option("N", "Random graphs that run in parallel; one per core if left out.", min=1)
    ] = None,
    out: Annotated[
        Path | None, option("DIR", "Folder for the report, new or empty; runs/reproduce/TIME if left out.")
    ] = None,
) -> None:
    """Reproduce the paper, and write one report.

    The report compares every table, figure and claim with the paper.

    Example:  gridpeers reproduce --driver inprocess
    """
    from gridpeers.papers.singhal2022.paper_benchmarks import headline
    from gridpeers.papers.singhal2022.reproduce.paper_report import Reproduction, write
    from gridpeers.papers.singhal2022.reproduce.work import CHOICES, Work, chosen

    if only is not None:
        check_choice("--only: ", "part", only, CHOICES)
    now, console = datetime.now().astimezone(), terminal()  # noqa: TID251  # folders are named by the day
    folder = new_folder(out, "reproduce", now)
    work = Work(chosen(only), driver, folder, seed, jobs)
    left = f"what came until then is in {shown(folder)}/"
    try:
        with interruptible():
            with remaining(console, work.total_s) as tell:
                results = tuple(work.do(tell, figures=only != "tables"))
            started = now.isoformat(sep=" ", timespec="minutes")
            whole = Reproduction(results=results, driver=driver, seed=work.seed, started=started)
            write(whole, work, folder)
    except gp.ScenarioError as error:
        set_broken(folder, "; ".join(error.problems))
        raise
    except (RuntimeError, OSError) as error:
        why = refusal(folder, error) if isinstance(error, OSError) else str(error)
        set_broken(folder, why)
        fail(f"a run broke: {why}", left, code=BROKEN)
    except OutputLostError as error:
        set_broken(folder, str(error))
        raise
    except KeyboardInterrupt as error:
        set_broken(folder, "interrupted")
        fail(f"interrupted; {left}", code=exit_code(error))
    for result in whole.results:
        for verdict in result.verdicts:
            if verdict.status != "PASS":
                text = f"{verdict.status:7}  {result.part.name}: {verdict.claim.text}  {verdict.found}"
                console.print(text, soft_wrap=True)
            if verdict.status == "MISS":
                console.print(f"{'':7}  {verdict.claim.known_miss}", soft_wrap=True)
    for line in (*headline(whole.numbers), whole.claims, f"It took {whole.took}."):
        console.print(line, soft_wrap=True)
    console.print(f"Report: {shown(folder / 'report.html')}", soft_wrap=True)
    raise typer.Exit(CLAIM_FAILED if whole.failed else PASSED)
