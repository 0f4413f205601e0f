"""The plant beside other simulators: python -m bench.validation [PART ...].

docs/understand/evidence.md sums up its tables. Exit code: 0 all limits are kept, 1 one is broken, 2 a part cannot run.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from bench.harness import markdown, say
from bench.validation.autotests import AUTOTESTS
from bench.validation.both_plants import GRIDLABD
from bench.validation.grid_forming import GRID_FORMING
from bench.validation.power_flow import POWER_FLOW
from bench.validation.random_feeders import RANDOM_FEEDERS
from bench.validation.validation_part import CaseResult, ValidationPart

PARTS = {part.name: part for part in (POWER_FLOW, GRIDLABD, AUTOTESTS, GRID_FORMING, RANDOM_FEEDERS)}
"""In the order in which they run."""


def main(
    parts: Annotated[
        list[str] | None, typer.Argument(help=f"{', '.join(PARTS)}; all of them by default.", show_default=False)
    ] = None,
) -> None:
    """Run parts of the cross-validation, and print a table of each."""
    if unknown := [name for name in parts or () if name not in PARTS]:
        raise typer.BadParameter(f'part "{unknown[0]}": there is no such part; choose from {", ".join(PARTS)}')
    chosen = [PARTS[name] for name in parts or PARTS]
    if missing := [part.missing() for part in chosen if part.missing()]:
        print("\n".join(missing), file=sys.stderr)
        raise typer.Exit(2)
    broken = []
    for part in chosen:
        results = []
        for case in part.cases:
            say(f"{part.name}: {case}")
            results.append(part.run(case))
        print(f"\n{part.name}, compared with {part.references()}\n\n{table(part, results)}", flush=True)
        broken += [f"{part.name}: {problem}" for result in results for problem in result.broken()]
    print("\n".join(broken), end="\n" if broken else "", file=sys.stderr)
    raise typer.Exit(1 if broken else 0)


def table(part: ValidationPart, results: Sequence[CaseResult]) -> str:
    """Return the results of a part as Markdown: a row for each case, a column for each quantity and fact."""
    quantities = list(dict.fromkeys(each.quantity for result in results for each in result.checks))
    facts = list(dict.fromkeys(fact for result in results for fact in result.facts))
    rows = []
    for result in results:
        values = {each.quantity: each.text() for each in result.checks}
        limits = dict.fromkeys(f"{'>= ' if each.at_least else ''}{each.limit:g}" for each in result.checks)
        numbers = [values.get(quantity, "") for quantity in quantities]
        case = f"`{result.case}`: {part.cases[result.case]}"
        rows.append([case, *numbers, ", ".join(limits), *(result.facts.get(fact, "") for fact in facts)])
    return markdown(["case", *quantities, "limit", *facts], rows)


app = typer.Typer(add_completion=False, rich_markup_mode=None)
app.command()(main)

if __name__ == "__main__":
    app()
