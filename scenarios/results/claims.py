"""What the paper claims of its islanding experiment, each claim with a verdict on our run.

A claim is a sentence, its place in the paper, the cases it needs, and a function from our results to what we found.
Tolerances of single numbers are in `paper_tables`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from scenarios.results.metrics import F_BAND, Steady
from scenarios.results.paper_tables import COLUMNS, ISLANDING, Column, Quantity

Results = Mapping[str, Mapping[str, Steady]]
"""Steady values by case and event."""

Status = Literal["PASS", "FAIL", "MISS", "NOT RUN"]
"""MISS: it does not hold, for a reason that is known and told; NOT RUN: a case that it is about was left out."""

EVENTS = ("event1", "event2")
"""Events of the islanding experiment."""


@dataclass(frozen=True, kw_only=True)
class Start:
    """What claims need to know of how the run began."""

    P_set0: float
    """First P_set of every inverter (pu)."""
    GFL: tuple[str, ...]
    """Names of the grid-following inverters."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One sentence of the paper that a run can confirm or refute."""

    name: str
    """Short name, for tests and files."""
    text: str
    """The claim."""
    source: str
    """Where the paper says it."""
    cases: tuple[str, ...]
    """Cases that must have been run."""
    judge: Callable[[Results, Start], tuple[bool, str]]
    """Whether it holds, and what we found."""
    events: tuple[str, ...] = EVENTS
    """Events that must have been measured in them."""
    known_miss: str = ""
    """Why it cannot hold here, where that is known. It is shown as a miss then, and does not fail the run."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """A claim judged."""

    claim: Claim
    status: Status
    found: str
    """Our value, with its unit."""


def judge(results: Results, start: Start, claims: tuple[Claim, ...] | None = None) -> tuple[Verdict, ...]:
    """Judge the claims of the islanding experiment by our results."""
    return tuple(_verdict(claim, results, start) for claim in (CLAIMS if claims is None else claims))


def within(column: Column, case: str, event: str, ours: float) -> bool | None:
    """Whether one number of ours is within its tolerance of the paper's; None when the column has none.

    Both count at the precision of the computation: the paper's printed 0.14 stands for exactly 0.14.
    """
    if column.tolerance is None:
        return None
    return abs(ours - ISLANDING[case][event][column.quantity]) <= column.tolerance


def _verdict(claim: Claim, results: Results, start: Start) -> Verdict:
    missing = [case for case in claim.cases if case not in results]
    if missing:
        return Verdict(claim=claim, status="NOT RUN", found=f"needs case {', '.join(missing)}")
    absent = [event for event in claim.events if any(event not in results[case] for case in claim.cases)]
    if absent:
        return Verdict(claim=claim, status="NOT RUN", found=f"needs {' and '.join(absent)}")
    holds, found = claim.judge(results, start)
    if not holds and claim.known_miss:
        return Verdict(claim=claim, status="MISS", found=found)
    return Verdict(claim=claim, status="PASS" if holds else "FAIL", found=found)


def _near_the_table(column: Column) -> Claim:
    """All numbers of one column are near the paper's."""

    def compare(results: Results, start: Start) -> tuple[bool, str]:
        cells = [(case, event) for case in ISLANDING for event in EVENTS]
        off = {cell: abs(_of(results, column, *cell) - ISLANDING[cell[0]][cell[1]][column.quantity]) for cell in cells}
        worst = max(cells, key=lambda cell: off[cell] if off[cell] == off[cell] else float("inf"))
        unit = {"f_error_Hz": " Hz", "V_error": " pu"}.get(column.quantity, "")
        holds = all(within(column, *cell, _of(results, column, *cell)) for cell in cells)
        return holds, f"at most off by {off[worst]:.4f}{unit} (case {worst[0]}, {worst[1]})"

    unit = {"f_error_Hz": " Hz", "V_error": " pu"}.get(column.quantity, "")
    return Claim(
        name=f"table_{column.table}_{column.quantity}",
        text=f"all eight {column.heading.split()[0]} within {column.tolerance:g}{unit} of Table {column.table}",
        source=f"Table {column.table}",
        cases=tuple(ISLANDING),
        judge=compare,
    )


def _of(results: Results, column: Column, case: str, event: str) -> float:
    return float(getattr(results[case][event], column.quantity))


def _only_IV_restores(results: Results, start: Start) -> tuple[bool, str]:
    errors = {case: results[case]["event1"].f_error_Hz for case in ISLANDING}
    holds = errors["IV"] < F_BAND and all(errors[case] >= F_BAND for case in ("I", "II", "III"))
    return holds, "abs(f-60) " + ", ".join(f"{case} {error:.3f}" for case, error in errors.items()) + " Hz"


def _IV_within_1_s(results: Results, start: Start) -> tuple[bool, str]:
    times = [results["IV"][event].t_restore_s for event in EVENTS]
    shown = ("never" if t is None else f"{t:.2f} s" for t in times)
    return all(t is not None and t <= 1.0 for t in times), _by_event(shown)


def _GFL_idle(results: Results, start: Start) -> tuple[bool, str]:
    off = {
        case: max(abs(results[case]["event2"].p[name] - start.P_set0) for name in start.GFL) for case in ("II", "III")
    }
    return max(off.values()) < 0.01, ", ".join(f"{case} within {value:.4f} pu" for case, value in off.items())


def _MQSI_order(results: Results, start: Start) -> tuple[bool, str]:
    rows = [[results[case][event].MQSI for case in ("II", "III", "IV")] for event in EVENTS]
    return all(II >= III > IV for II, III, IV in rows), _by_event(" / ".join(f"{x:.2f}" for x in row) for row in rows)


def _IV_shares_vars(results: Results, start: Start) -> tuple[bool, str]:
    values = [results["IV"][event].MQSI for event in EVENTS]
    return max(values) <= 0.1, _by_event(f"{x:.3f}" for x in values)


def _IV_5_times_below_II_and_III(results: Results, start: Start) -> tuple[bool, str]:
    pairs = [(results[case][event].MQSI, results["IV"][event].MQSI) for case in ("II", "III") for event in EVENTS]
    ratios = [_ratio(*pair) for pair in pairs]
    return min(ratios) >= 5.0, f"least ratio {min(ratios):.1f}"


def _IV_5_times_better_than_I(quantity: Quantity) -> Callable[[Results, Start], tuple[bool, str]]:
    def compare(results: Results, start: Start) -> tuple[bool, str]:
        ratios = [_ratio(*(getattr(results[case][event], quantity) for case in ("I", "IV"))) for event in EVENTS]
        return min(ratios) > 5.0, _by_event(f"{ratio:.1f} times" for ratio in ratios)

    return compare


def _ratio(before: float, after: float) -> float:
    return before / after if after else math.inf


def _by_event(values: Iterable[str]) -> str:
    return ", ".join(f"{event} {value}" for event, value in zip(EVENTS, values, strict=True))


CLAIMS: tuple[Claim, ...] = (
    *(_near_the_table(column) for column in COLUMNS if column.tolerance is not None),
    Claim(
        name="only_IV_restores",
        text="only IV restores 60 Hz after event 1",
        source="section 4, Table I",
        cases=("I", "II", "III", "IV"),
        judge=_only_IV_restores,
    ),
    Claim(
        name="IV_within_1_s",
        text="IV: abs(f-60) < 0.01 Hz and MPSI < 0.01 within 1 s",
        source="section 4, figures of f and MPSI",
        cases=("IV",),
        judge=_IV_within_1_s,
    ),
    Claim(
        name="GFL_idle",
        text="II, III: GFL return to their first power after event 2",
        source="section 4, figure of P",
        cases=("II", "III"),
        judge=_GFL_idle,
    ),
    Claim(
        name="MQSI_order",
        text="MQSI of III lies between those of II and IV",
        source="section 4, Table II",
        cases=("II", "III", "IV"),
        judge=_MQSI_order,
    ),
    Claim(
        name="IV_shares_vars",
        text="IV: MQSI at most 0.1",
        source="Table II (0.04 and 0.05)",
        cases=("IV",),
        judge=_IV_shares_vars,
    ),
    Claim(
        name="IV_5_times_below_II_and_III",
        text="MQSI of IV at least 5 times below those of II and III",
        source="Table II",
        cases=("II", "III", "IV"),
        judge=_IV_5_times_below_II_and_III,
    ),
    Claim(
        name="IV_MQSI_5_times_better_than_I",
        text="IV improves MQSI more than 5 times over I",
        source="section 4, Table II",
        cases=("I", "IV"),
        judge=_IV_5_times_better_than_I("MQSI"),
    ),
    Claim(
        name="IV_V_error_5_times_better_than_I",
        text="IV improves V_error more than 5 times over I",
        source="section 4, Table II",
        cases=("I", "IV"),
        judge=_IV_5_times_better_than_I("V_error"),
        known_miss="with equal vars, the terminals of our feeder are 0.003 pu from nominal (docs/results.md)",
    ),
)
"""Claims of the islanding experiment."""
