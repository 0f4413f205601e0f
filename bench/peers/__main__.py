"""Ours beside its peers: python -m bench.peers [PART ...].

Rivals take turns, round by round. Exit code: 0 all is measured, or its rival is not installed; 1 something failed, and
is named; 2 bad usage.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from bench.harness import say
from bench.peers.measured import PartRun, measure_in_turns, tables_text
from bench.peers.parts import PARTS, SHORT, Extent
from gridpeers.scenarios.results.run_files import write_whole


def measure(
    parts: Annotated[
        list[str] | None,
        typer.Argument(
            help=" ".join(f"{name}: {part.__doc__}" for name, part in PARTS.items()) + " All of them by default.",
            show_default=False,
        ),
    ] = None,
    repeat: Annotated[int, typer.Option(min=1, help="Rounds of each part.")] = 5,
    json: Annotated[Path | None, typer.Option(help="Write the measurements of every round there.")] = None,
    short: Annotated[bool, typer.Option("--short", help="A try: its numbers mean nothing.")] = False,
) -> None:
    """Measure ours beside its peers, and print medians and ratios as tables."""
    if unknown := [name for name in parts or () if name not in PARTS]:
        raise typer.BadParameter(f'part "{unknown[0]}": there is no such part; choose from {", ".join(PARTS)}')
    extent = SHORT if short else Extent(rounds=repeat)
    measured: dict[str, PartRun] = {}
    for name in parts or PARTS:
        say(name)
        measured[name] = measure_in_turns(partial(PARTS[name], extent), extent.rounds, say)
        if json:  # each part is kept once it is measured
            write_whole(json, msgspec.json.format(msgspec.json.encode(measured), indent=1).decode() + "\n")
    print(tables_text(measured))
    failures = [
        f"{name}: {what}: {why}" for name, run in measured.items() if run.failed for what, why in run.left_out.items()
    ]
    print("\n".join(failures), end="\n" if failures else "", file=sys.stderr)
    raise typer.Exit(1 if failures else 0)


app = typer.Typer(add_completion=False, rich_markup_mode=None)
app.command()(measure)

if __name__ == "__main__":
    app()
