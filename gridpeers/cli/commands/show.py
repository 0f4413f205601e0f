"""Commands that show what there is: `list`, `check`, `doc`."""

from __future__ import annotations

from itertools import chain
from typing import Annotated, Literal, get_args

import typer

from gridpeers.cli.usage import BAD_INPUT, fail, load, require
from gridpeers.wire.wording import counted

Topic = Literal["keys", "messages", "scenario", "feeder", "laws", "metrics", "claims", "checks", "faults", "graphs"]
"""Values of the argument of `doc`."""


def list_() -> None:
    """List the scenarios that come with gridpeers.

    Example:  gridpeers list
    """
    from gridpeers.scenarios.catalogue_files import summaries

    scenarios = summaries()
    width = max(map(len, scenarios), default=0)
    for name, (title, cases) in scenarios.items():
        typer.echo(f"{name:{width}}  {title}. Cases: {', '.join(cases)}")


def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="Path of a scenario file, or a name from the catalogue.")],
) -> None:
    """Check a scenario file and its feeder for problems.

    All problems come at once. A file without any is tried: whether its feeder has an operating point to start from.
    Notes tell what its events de-energise, which agents lie, where a graph bears fewer liars than
    its law should, and how to run it if it asks for certificates.

    Exit code: 0 it can be run, 2 it has problems.

    Example:  gridpeers check my-islanding.toml
    """
    spec, feeder = load(file)
    require({"numba": "the plant", "scipy": "the plant", "threadpoolctl": "the plant"})

    from gridpeers.cli.progress import TRYING, explained
    from gridpeers.rooms import ROOMS
    from gridpeers.scenarios.results.file_sizes import file_sizes
    from gridpeers.scenarios.schema.check_notes import liar_notes, security_notes, start_problem
    from gridpeers.scenarios.schema.supply import supply_notes

    with explained(lambda: typer.echo(TRYING)):
        problem = start_problem(spec, feeder)
    if problem:
        fail([f"{file}: the plant cannot start: {problem}"], BAD_INPUT)
    robustness_notes = ROOMS.resolve("robustness_notes")
    notes = (supply_notes(spec, feeder), liar_notes(spec, feeder), robustness_notes(spec, feeder))
    for note in chain(*notes, security_notes(spec, feeder, file)):
        typer.echo(f"NOTE  {note}")
    typer.echo(
        f"{file}: can be run: {counted(len(spec.cases), 'case')} {', '.join(spec.cases)}; "
        f"{counted(len(spec.events), 'event')}; {spec.time.end_s:g} s; "
        f"{counted(len(feeder.inverters), 'inverter')} on {counted(len(feeder.buses), 'bus', 'buses')}"
        + (f"; {sentence}" if (sentence := file_sizes(spec, feeder).sentence) else "")
    )


def doc(
    topic: Annotated[Topic, typer.Argument(metavar="TOPIC", help=f"What to print: {', '.join(get_args(Topic))}.")],
) -> None:
    """Print a reference page that is made from the code.

    keys and messages are those of the wire; scenario is the scenario file, with units and defaults; laws, metrics,
    claims, checks, faults and graphs are what can be plugged in: those that there are, with parameters, and your own.

    Example:  gridpeers doc scenario
    """
    from gridpeers.scenarios.reference import page

    typer.echo(page(topic), nl=False)
