"""A claim and its verdict.

A claim is a sentence, its place in a publication, the cases and events it needs, and a function from what we found to
whether it holds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from scenarios.results.findings import Findings
from scenarios.results.quantities import Quantity
from wire.anybody import ANYTHING, named

Status = Literal["PASS", "FAIL", "MISS", "NOT RUN"]
"""MISS: it does not hold, for a reason that is known and told; NOT RUN: a case that it is about was left out."""

Measure = Quantity | Literal["p"]
"""A steady value: a quantity of the tables, or the powers of the inverters."""

Judge = Callable[[Findings], tuple[bool, str]]
"""Whether it holds, and what we found, with units."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One sentence that a run can confirm or refute."""

    name: str
    """Short name, for tests and files."""
    text: str
    """The claim."""
    source: str
    """Where it is said."""
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
    """Judge claims by what was found; one that raises an exception fails, and its verdict says why."""
    verdicts = []
    for claim in claims:
        try:
            verdicts.append(_verdict(claim, found))
        except ANYTHING as error:  # a claim is anybody's code
            verdicts.append(
                Verdict(claim=claim, status="FAIL", found=f"cannot be judged: {named(error)}{_there(error, found)}")
            )
    return tuple(verdicts)


def _there(error: BaseException, found: Findings) -> str:
    """Names that there are, for a claim that asked for another."""
    if not isinstance(error, KeyError):
        return ""
    known = {
        "cases": dict.fromkeys(found.results),
        "events": dict.fromkeys(event for of in found.results.values() for event in of),
        "scenario's own metrics": dict.fromkeys(
            n for of in found.own.values() for one in of.values() for n in one.values
        ),
    }
    return "".join(f"; the {kind} are {', '.join(names)}" for kind, names in known.items() if names)


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
    holds, told = claim.judge(found)
    text = str(told)
    if not holds and claim.known_miss:
        return Verdict(claim=claim, status="MISS", found=text)
    unsteady = found.unsteady(claim.cases, claim.events, claim.measures)
    if holds and unsteady:
        more = f", and {len(unsteady) - 1} more" if len(unsteady) > 1 else ""
        return Verdict(claim=claim, status="FAIL", found=f"{text}, but {unsteady[0]}{more}")
    return Verdict(claim=claim, status="PASS" if holds else "FAIL", found=text)
