"""Benchmarks: the paper's numbers and claims for each experiment, and a summary of our distance from them.

The scenario's key `paper` names the experiment. The summary counts every number: with a tolerance, without one, and
V_error in proportion to its size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from gridpeers import Benchmark, Claim, Findings
from gridpeers.papers.singhal2022 import communication_claims, islanding_claims, plant_claims
from gridpeers.papers.singhal2022.tables import MQSI_FACTOR, V_RELATIVE, Cell, PaperTable, tables_of


class ComparedNumber(NamedTuple):
    """A number of the paper with ours."""

    cell: Cell
    ours: float
    """Not a number where ours is not steady."""


def numbers(found: Findings, tables: Iterable[PaperTable]) -> list[ComparedNumber]:
    """Return all numbers of tables that were run, ours beside the paper's."""
    cells = [cell for table in tables for cell in table.cells if found.has(cell)]
    return [ComparedNumber(cell, float("nan") if found.reason(cell) else found.value(cell)) for cell in cells]


def within(all_numbers: Iterable[ComparedNumber], judge: Callable[[Cell, float], bool | None]) -> tuple[int, int]:
    """Return the number of those that pass a judgement, and of those that it judges."""
    passed = [judge(cell, ours) for cell, ours in all_numbers]
    return sum(map(bool, passed)), sum(verdict is not None for verdict in passed)


def headline(all_numbers: Sequence[ComparedNumber]) -> list[str]:
    """Return lines on numbers with a tolerance, on those without, and on V_error in proportion to its size."""
    lines = []
    near, judged = within(all_numbers, Cell.within)
    if judged:
        named = _tables(all_numbers)
        lines.append(f"{near} of {judged} numbers of {named} are within their tolerance.")
    if left := [number for number in all_numbers if number.cell.tolerance.value is None]:
        near, _ = within(left, Cell.within_factor)
        times = [ours / cell.paper for cell, ours in left if not math.isnan(ours)]
        times_off = f"{min(times):.2g} to {max(times):.2g} times the paper's, " if times else ""
        far = _farthest(left, lambda cell, ours: abs(math.log(ours / cell.paper)) if ours > 0.0 else math.inf)
        lines.append(
            f"{len(left)} numbers, all MQSI of {_tables(left)}, have no tolerance: {times_off}"
            f"{near} of {len(left)} within a factor of {MQSI_FACTOR:g}; largest difference: {far}."
        )
    if about := [number for number in all_numbers if number.cell.relative is not None]:
        near, judged = within(about, Cell.within_relative)
        far = _farthest(about, lambda cell, ours: abs(ours - cell.paper) / (cell.relative or math.nan))
        lines.append(
            f"V_error: {near} of {judged} numbers within {100 * V_RELATIVE:g} % of the paper's, or half of "
            f"its last digit; largest difference: {far}."
        )
    return lines


def _farthest(some: Sequence[ComparedNumber], off: Callable[[Cell, float], float]) -> str:
    """Return the number with the largest difference, and the paper's; NaN comes before all others."""
    cell, ours = max(some, key=lambda one: math.inf if math.isnan(one.ours) else off(*one))
    shown = "not steady" if math.isnan(ours) else f"{ours:.{cell.digits + 1}f}"
    return f"{shown}, paper {cell.paper:.{cell.digits}f} (Table {cell.table}, {cell.where})"


def _tables(some: Iterable[ComparedNumber]) -> str:
    """Return the tables by their numbers, e.g. "Tables I and II"."""
    *named, last = dict.fromkeys(number.cell.table for number in some)
    return f"Tables {', '.join(named)} and {last}" if named else f"Table {last}"


CLAIMS: dict[str, tuple[Claim, ...]] = {
    "islanding": islanding_claims.claims.all,
    "intermittency": plant_claims.intermittency.all,
    "communication": communication_claims.communication.all,
    "topology": communication_claims.topology.all,
    "plug-n-play": plant_claims.plug_n_play.all,
    "switching": plant_claims.switching.all,
    "wind-up": plant_claims.wind_up.all,
}
"""Claims by the scenario's key `paper`; "topology" is a sweep without a scenario."""


def _benchmark(experiment: str) -> Benchmark:
    tables = tables_of(experiment)
    return Benchmark(
        numbers=tuple(cell for table in tables for cell in table.cells),
        claims=CLAIMS[experiment],
        summary=lambda found: headline(numbers(found, tables)),
    )


ISLANDING = _benchmark("islanding")
INTERMITTENCY = _benchmark("intermittency")
COMMUNICATION = _benchmark("communication")
SWITCHING = _benchmark("switching")
PLUG_N_PLAY = _benchmark("plug-n-play")
WIND_UP = _benchmark("wind-up")
