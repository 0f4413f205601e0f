"""The command `gridpeers chaos`. What it needs is imported when it is used, so that help comes at once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from gridpeers.cli.usage import (
    BROKEN,
    CLAIM_FAILED,
    PASSED,
    ScenarioName,
    chosen,
    fail,
    load,
    option,
    require,
    terminal,
)

if TYPE_CHECKING:
    from rich.console import Console

    from gridpeers.lab.chaos.campaign import Campaign


def chaos(
    scenario: ScenarioName,
    runs: Annotated[int, option("N", "Number of runs.", min=1)] = 100,
    driver: Annotated[
        Literal["inprocess", "processes"],
        typer.Option(help="inprocess: each run in one process; processes: also with a process per agent."),
    ] = "inprocess",
    seed: Annotated[int, option("S", "Seed of the disturbances.", min=0, max=10**9)] = 1,
    case: Annotated[str | None, option("NAME", "Case to disturb; the last one of the file if left out.")] = None,
    jobs: Annotated[int | None, option("N", "Parallel processes; one per core if left out.", min=1)] = None,
    out: Annotated[
        Path | None, option("DIR", "Folder for the results, new or empty; runs/SCENARIO-chaos/TIME if left out.")
    ] = None,
) -> None:
    """Disturb a scenario at random, and shrink the failures.

    Agents are killed and paused, leave and join; links are cut, slow and lossy; switches open and close; agents lie.
    After the last disturbance, the checks judge the run (docs/how-to/chaos.md). For each kind of failure, the command
    writes a scenario file with few disturbances, for `gridpeers run`.

    Example:  gridpeers chaos islanding --runs 200
    """
    spec, feeder = load(scenario)
    spec = chosen(spec, case or list(spec.cases)[-1], None)
    if len(spec.cases) > 1:
        fail(f"--case: takes one case, got {case}")
    if (simulator := spec.plant.simulator) != "gridpeers":
        fail(f'{scenario}: plant.simulator = "{simulator}" lets no inverter leave or join; use "gridpeers"')
    if spec.security == "mtls" and driver == "processes":
        fail(f'{scenario}: security = "mtls" needs certificates, and chaos uses no certificates; remove it')
    require({"hypothesis": "the schedules", "joblib": "the runs over all cores"}, "chaos")
    from datetime import datetime

    from gridpeers.cli.progress import remaining
    from gridpeers.lab.chaos.campaign import Campaign
    from gridpeers.lab.chaos.disturbed_scenario import ChaosBase
    from gridpeers.scenarios.results.run_files import broken_if_ended, new_folder, set_status, shown
    from gridpeers.scenarios.sweep.workers import cores
    from gridpeers.wire.driver.command_line import command_line

    name, console = f"{spec.name}-chaos", terminal()
    campaign = Campaign(base=ChaosBase(spec, feeder), seed=seed, runs=runs, driver=driver, jobs=jobs or cores())
    words = ["--case", campaign.base.case, "--runs", str(runs), "--seed", str(seed), "--driver", driver]
    campaign.command = command_line("chaos", scenario, *words)
    with _told_if_ended(campaign):
        _try_undisturbed(console, campaign)
        # the folder is made only once the scenario has passed without disturbances
        path = campaign.path = new_folder(out, name, datetime.now().astimezone())  # noqa: TID251  # folders are named by the day
        set_status(path, "running")
        with broken_if_ended(path):
            campaign.begin()
        campaign.run(partial(remaining, console))
    for line in campaign.lines():
        typer.echo(line)
    typer.echo(f"\nResults: {shown(path)}/")
    raise typer.Exit(CLAIM_FAILED if campaign.violated else PASSED)


def _try_undisturbed(console: Console, campaign: Campaign) -> None:
    from gridpeers.cli.progress import TRYING, explained
    from gridpeers.lab.chaos.campaign import seed_of
    from gridpeers.lab.chaos.chaos_run import run_schedule
    from gridpeers.scenarios.checks.check_registry import ALWAYS
    from gridpeers.wire.wording import counted

    name = f"{campaign.base.scenario.name}, case {campaign.base.case}"
    typer.echo(f"{name}: first a run without disturbances ...")
    with explained(lambda: console.print(TRYING, soft_wrap=True)):
        row = run_schedule(campaign.base, (), seed_of(campaign.seed, 0))
    if row.violated:
        off = ", ".join(f'{{ use = "{check}", off = true }}' for check in row.violated if check in ALWAYS)
        entry = f": checks = [{off}] at its top" if off else ""
        page = "docs/reference/measures-and-checks.md"
        advice = f"choose another case (--case), or switch these checks off in the scenario{entry} ({page})"
        lines = [f"{name}: violated without any disturbance: {text}" for text in row.violated.values()]
        fail(*lines, advice)
    how = "each with processes and in one" if campaign.driver == "processes" else f"{campaign.jobs} at a time"
    typer.echo(f"{name}: it passes; now {counted(campaign.runs, 'run')} with disturbances, {how} ...")


@contextmanager
def _told_if_ended(campaign: Campaign) -> Iterator[None]:
    """Say what is kept of a campaign that ends early."""
    from gridpeers.cli.usage import exit_code, interruptible
    from gridpeers.scenarios.results.run_files import refusal, shown
    from gridpeers.scenarios.sweep.workers import WorkersError

    try:
        with interruptible():
            yield
    except (KeyboardInterrupt, OSError, MemoryError, WorkersError) as error:
        kept, path = len(campaign.rows), campaign.path
        where = "and no folder was made"
        if path and not path.is_dir():
            kept, where = 0, f"as {shown(path)}/ is gone"
        elif path:
            where = f"in {shown(path)}/"
        left = f"{kept} of {campaign.runs} runs are kept {where}"
        if isinstance(error, KeyboardInterrupt):
            fail(f"interrupted; {left}", code=exit_code(error))
        if isinstance(error, OSError) and path:
            fail(refusal(path, error), left, code=BROKEN)
        fail(str(error) or "out of memory", left, code=BROKEN)
