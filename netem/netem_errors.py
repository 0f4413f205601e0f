"""What is wrong with a number or a name of a scenario's netem entries: where, what, the value, what was meant."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import NamedTuple

from netem.plausible_links import Range, objection

LONGEST_DELAY = 10.0
"""Delays above this (s) are taken for milliseconds by mistake: control over such a link is not what netem is for."""


LEAST = 1e-12
"""Least probability that must be above 0: one that is divided by leaves no number where it is as good as 0."""


class Mistake(NamedTuple):
    """One mistake."""

    path: str
    """Which key, e.g. `link[2].loss.p`; relative to the entry where a model finds it."""
    text: str
    """What is wrong, with the value and its unit, and what would be right."""


def below(path: str, mistakes: Iterable[Mistake]) -> list[Mistake]:
    """The same mistakes, seen from further up.

    Examples
    --------
    >>> below("link[2]", [Mistake("loss.p", "wrong"), Mistake("", "empty")])
    [Mistake(path='link[2].loss.p', text='wrong'), Mistake(path='link[2]', text='empty')]
    """
    return [Mistake(f"{path}.{mistake.path}" if mistake.path else path, mistake.text) for mistake in mistakes]


def probability(path: str, value: float, what: str, *, above_zero: bool = False) -> list[Mistake]:
    """A probability lies between 0 and 1.

    Examples
    --------
    >>> probability("loss.p", 30.0, "a loss")[0].text
    'a loss is a probability from 0 to 1, got 30; did you mean 0.3 (30 %)?'
    """
    if (LEAST if above_zero else 0.0) <= value <= 1.0:
        return []
    meant = f"; did you mean {value / 100.0:g} ({value:g} %)?" if 1.0 < value <= 100.0 else ""
    least = "above 0 and up to 1" if above_zero else "from 0 to 1"
    return [Mistake(path, f"{what} is a probability {least}, got {value:g}{meant}")]


def seconds(
    path: str, value: float, what: str, *, high: float = LONGEST_DELAY, above_zero: bool = False
) -> list[Mistake]:
    """A time is finite, not negative, and no longer than makes sense.

    Examples
    --------
    >>> seconds("delay", 250.0, "a delay")[0].text
    '250 s is not plausible for a delay (0 to 10 s); did you mean 0.25 (250 ms)?'
    >>> seconds("delay", -0.1, "a delay")[0].text
    'a delay must not be negative, got -0.1 s; 0 to 10 s makes sense'
    """
    return amount(path, value, Range(what, "s", 0.0, high, above_zero))


def amount(path: str, value: float, allowed: Range, hint: str = "") -> list[Mistake]:
    """A number lies within what makes sense; the hint is what is said beyond that.

    Examples
    --------
    >>> amount("shape", 0.0, Range("a Pareto shape", "", 0.5, 50.0))[0].text
    '0 is not plausible for a Pareto shape (0.5 to 50)'
    """
    wrong = objection(value, allowed)
    return [Mistake(path, wrong + hint)] if wrong else []


def shown(raw: object) -> str:
    """Write a value as TOML writes it, or nearly."""
    return json.dumps(raw, ensure_ascii=False, default=str)
