"""The command `gridpeers reproduce`. It imports heavy packages when it runs, so that help comes at once."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import gridpeers as gp
from gridpeers.cli.usage import (
    BAD_INPUT,
    BROKEN,
    CLAIM_FAILED,
    PASSED,
    RUN,
    Dask,
    check_choice,
    exit_code,
    fail,
    interruptible,
    refuse,
    require,
    terminal,
)
from gridpeers.papers.singhal2022.reproduce.parts import CHOICES, chosen

if TYPE_CHECKING:
    from gridpeers.papers.singhal2022.reproduce.report import Reproduction


def reproduce(
    driver: Annotated[
        str, typer.Option(help="processes: one process per agent, over Zenoh; inprocess: all in one.", metavar="NAME")
    ] = "processes",
    only: Annotated[
        str | None,
        typer.Option(
            metavar="WHAT", help="tables: what has tables, without figures; figures; or a part by its scenario's name."
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Seed instead of the scenarios' own, also of random graphs.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Random graphs at a time; one per core when left out.")
    ] = None,
    dask: Dask = "",
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for the report, new or empty; runs/reproduce/TIME when left out."),
    ] = None,
) -> None:
    """Run all experiments of the paper, and write one report.

    Every table, figure and claim of ours stands beside the paper's.

    Exit code: 0 no claim failed (a known miss is shown, with its reason, and is no failure), 1 a claim failed,
    2 bad usage, 3 a run broke.

    Example:  gridpeers reproduce --driver inprocess
    """
    check_choice("--driver: ", "driver", driver, ("processes", "inprocess"))
    if only is not None:
        check_choice("--only: ", "part", only, CHOICES)
    packages = RUN | ({"joblib": "--dask", "distributed": "--dask"} if dask else {})
    require(packages | ({"zenoh": "the driver with processes"} if driver == "processes" else {}))
    from datetime import datetime

    from gridpeers.cli.progress import remaining
    from gridpeers.output_folders import FolderError, OutputLostError, new_folder, refusal, set_broken, shown
    from gridpeers.papers.singhal2022.reproduce.report import Reproduction, write
    from gridpeers.papers.singhal2022.reproduce.work import ReproduceDriver, Work

    now = datetime.now().astimezone()
    try:
        folder = new_folder(out, "reproduce", now)
    except FolderError as error:
        fail([str(error)], BAD_INPUT)

    console = terminal()
    by: ReproduceDriver = "inprocess" if driver == "inprocess" else "processes"
    work = Work(chosen(only), by, folder / "runs", seed, jobs, dask)
    results = []
    try:
        with interruptible():
            with remaining(console, work.total_s) as tell:
                for result in work.do(tell, figures=only != "tables"):
                    results.append(result)
            whole = Reproduction(
                results=tuple(results),
                driver=driver,
                seed=work.seed,
                started=now.isoformat(sep=" ", timespec="minutes"),
            )
            write(whole, work, folder)
    except gp.ScenarioError as error:
        set_broken(folder, "; ".join(error.problems))
        refuse(error)
    except (RuntimeError, OSError) as error:
        why = refusal(folder, error) if isinstance(error, OSError) else str(error)
        set_broken(folder, why)
        fail([f"a run broke: {why}", f"what came until then is in {shown(folder)}/"], BROKEN)
    except OutputLostError as error:
        set_broken(folder, str(error))
        raise
    except KeyboardInterrupt as error:
        set_broken(folder, "interrupted")
        fail([f"interrupted; what came until then is in {shown(folder)}/"], exit_code(error))
    for line in _summary(whole):
        console.print(line, soft_wrap=True)
    console.print(f"Report: {shown(folder / 'report.html')}", soft_wrap=True)
    raise typer.Exit(CLAIM_FAILED if whole.failed else PASSED)


def _summary(whole: Reproduction) -> list[str]:
    """Return the end in lines: every claim that does not hold, and the counts."""
    from gridpeers.papers.singhal2022.paper_benchmarks import headline

    lines = []
    for result in whole.results:
        for verdict in result.verdicts:
            if verdict.status != "PASS":
                lines.append(f"{verdict.status:7}  {result.part.name}: {verdict.claim.text}  {verdict.found}")
                lines += [f"{'':7}  {verdict.claim.known_miss}"] if verdict.status == "MISS" else []
    took = f"It took {whole.wall_s:.0f} s, {whole.cpu_s:.0f} s of processor time."
    return [*lines, *headline(whole.numbers), whole.claims, took]
