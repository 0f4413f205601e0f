"""A claim of the paper and its verdict.

A claim is a sentence, its place in the paper, the cases and events it needs, and a function from what we found to
whether it holds. Tolerances are in `scenarios.results.tolerances`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from scenarios.results.findings import Findings, label
from scenarios.results.paper_tables import UNITS, Cell, tables_of
from scenarios.results.tolerances import V_RELATIVE, Number, Quantity

Status = Literal["PASS", "FAIL", "MISS", "NOT RUN"]
"""MISS: it does not hold, for a reason that is known and told; NOT RUN: a case that it is about was left out."""

Measure = Quantity | Literal["p"]
"""A steady value: a column of the paper's tables, or the powers of the inverters."""

Judge = Callable[[Findings], tuple[bool, str]]
"""Whether it holds, and what we found, with units."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One sentence of the paper that a run can confirm or refute."""

    name: str
    """Short name, for tests and files."""
    text: str
    """The claim."""
    source: str
    """Where the paper says it."""
    judge: Judge
    measures: tuple[Measure, ...]
    """Steady values that it is judged by: it does not pass while one of them is not steady, or no number."""
    cases: tuple[str, ...] = ()
    """Cases that must have been run."""
    events: tuple[str, ...] = ()
    """Events that must have been measured in them."""
    lacking: Callable[[Findings], str] = lambda _: ""
    """What there must be and is not, e.g. an island; it fails then, also as a known miss. "" where nothing lacks."""
    figure: str = ""
    """Figure of the report that shows it; "" for a claim about a table."""
    known_miss: str = ""
    """Why it cannot hold here, where that is known. It is shown as a miss then, and does not fail the run."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """A claim judged."""

    claim: Claim
    status: Status
    found: str
    """Our value, with its unit."""


def judge(found: Findings, claims: Sequence[Claim]) -> tuple[Verdict, ...]:
    """Judge claims by what was found."""
    return tuple(_verdict(claim, found) for claim in claims)


def _verdict(claim: Claim, found: Findings) -> Verdict:
    results = found.results
    missing = [case for case in claim.cases if case not in results]
    if missing:
        return Verdict(claim=claim, status="NOT RUN", found=f"needs case {', '.join(missing)}")
    absent = [event for event in claim.events if any(event not in results[case] for case in claim.cases)]
    if absent:
        return Verdict(claim=claim, status="NOT RUN", found=f"needs {' and '.join(absent)}")
    if lacking := claim.lacking(found):
        return Verdict(claim=claim, status="FAIL", found=lacking)
    holds, text = claim.judge(found)
    if not holds and claim.known_miss:
        return Verdict(claim=claim, status="MISS", found=text)
    unsteady = found.unsteady(claim.cases, claim.events, claim.measures)
    if holds and unsteady:
        more = f", and {len(unsteady) - 1} more" if len(unsteady) > 1 else ""
        return Verdict(claim=claim, status="FAIL", found=f"{text}, but {unsteady[0]}{more}")
    return Verdict(claim=claim, status="PASS" if holds else "FAIL", found=text)


def near_the_table(experiment: str, number: Number, quantity: Quantity) -> Claim:
    """The claim that all numbers of one column of a table are near the paper's."""
    cells = _column(experiment, number, quantity)
    tolerance = cells[0].tolerance.value
    return _near(
        f"table_{number}_{quantity}",
        f"all {_WORDS.get(len(cells), str(len(cells)))} {label(quantity)} within {tolerance:g}{UNITS[quantity]} of "
        f"Table {number}",
        cells,
        Cell.within,
    )


def near_relatively(experiment: str, number: Number, known_miss: str = "") -> Claim:
    """The claim that all V_error of a table are near the paper's beside their own size."""
    cells = _column(experiment, number, "V_error")
    text = (
        f"all {_WORDS.get(len(cells), str(len(cells)))} V_error within {100 * V_RELATIVE.value:g} % of Table {number}'s"
    )
    return _near(f"table_{number}_V_error_relative", text, cells, Cell.within_relative, known_miss)


def _column(experiment: str, number: Number, quantity: Quantity) -> tuple[Cell, ...]:
    table = next(table for table in tables_of(experiment) if table.number == number)
    return tuple(cell for cell in table.cells if cell.quantity == quantity)


def _near(
    name: str, text: str, cells: Sequence[Cell], within: Callable[[Cell, float], bool | None], known_miss: str = ""
) -> Claim:
    """The claim that all our numbers pass a judgement beside the paper's."""
    unit = UNITS[cells[0].quantity]

    def lacking(found: Findings) -> str:
        absent = [cell for cell in cells if not found.has(cell)]
        return f"there is no such number: {absent[0].where}" if absent else ""

    def compare(found: Findings) -> tuple[bool, str]:
        ours = {cell: found.value(cell) for cell in cells}

        def off(cell: Cell) -> float:
            difference = abs(ours[cell] - cell.paper)
            return math.inf if math.isnan(difference) else difference

        worst = max(cells, key=off)
        failing = [cell for cell in cells if not within(cell, ours[cell])]
        some = f"{len(cells) - len(failing)} of {len(cells)}, " if failing else ""
        return not failing, f"{some}at most off by {abs(ours[worst] - worst.paper):.4f}{unit} ({worst.where})"

    return Claim(
        name=name,
        text=text,
        source=f"Table {cells[0].table}",
        cases=tuple(dict.fromkeys(cell.case for cell in cells)),
        events=tuple(dict.fromkeys(cell.event for cell in cells)),
        judge=compare,
        measures=(cells[0].quantity,),
        lacking=lacking,
        known_miss=known_miss,
    )


def ratio(before: float, after: float) -> float:
    """How many times smaller; nothing left is infinitely better."""
    return before / after if after else math.inf


def by_event(events: Iterable[str], values: Iterable[str]) -> str:
    """Words on several events."""
    return ", ".join(f"{event} {value}" for event, value in zip(events, values, strict=True))


def seconds(t: float | None) -> str:
    """Write a time that may never have come."""
    return "never" if t is None else f"{t:.2f} s"


_WORDS = {3: "three", 5: "five", 8: "eight"}
