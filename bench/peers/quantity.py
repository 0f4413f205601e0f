"""A number of the page: what it is computed from, its median, its spread over the rounds, and why it is missing."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from bench.peers.stored import Parts


class Quantity(NamedTuple):
    """A sum of measured values of one part, or the ratio of two sums."""

    part: str
    names: tuple[str, ...]
    """The values that are added."""
    over: tuple[str, ...] = ()
    """The values whose sum divides; none: it is no ratio."""
    scale: float = 1.0

    def rounds(self, parts: Parts) -> list[float]:
        """Return the number of each round; of a ratio both are of the same round, in which rivals took turns."""
        above = self._sums(parts, self.names)
        if not self.over:
            return [self.scale * each for each in above]
        return [self.scale * a / b for a, b in zip(above, self._sums(parts, self.over), strict=False) if b]

    def value(self, parts: Parts) -> float:
        """Return the median of the rounds; nan where a measurement is missing."""
        return median(found) if (found := self.rounds(parts)) else float("nan")

    def missing(self, parts: Parts) -> str:
        """Return why there is no number; "" where there is one."""
        return missing(parts, self.part, (*self.names, *self.over))

    def _sums(self, parts: Parts, names: Sequence[str]) -> list[float]:
        values = parts[self.part].values if self.part in parts else {}
        return [sum(each) for each in zip(*(values.get(name, ()) for name in names), strict=False)]


class Flatness(NamedTuple):
    """The largest of several costs in proportion to the least: 1 where the cost does not depend on the size."""

    part: str
    names: tuple[str, ...]
    """The values, one a size."""

    def rounds(self, parts: Parts) -> list[float]:
        """Return the proportion in each round, which has the noise of one measurement a size."""
        values = parts[self.part].values if self.part in parts else {}
        return [max(each) / min(each) for each in zip(*(values.get(name, ()) for name in self.names), strict=False)]

    def value(self, parts: Parts) -> float:
        """Return the proportion of the medians; nan where a size is missing."""
        if self.missing(parts):
            return float("nan")
        costs = [parts[self.part].median(name) for name in self.names]
        return max(costs) / min(costs)

    def missing(self, parts: Parts) -> str:
        """Return why there is no number; "" where there is one."""
        return missing(parts, self.part, self.names)


def missing(parts: Parts, part: str, names: Sequence[str]) -> str:
    """Return why one of some values of a part is missing; "" where all are there."""
    if part not in parts:
        kind, _, name = part.partition("-")
        return f"not measured yet: `python -m bench.{f'long_runs {name}' if kind == 'long' else f'peers {part}'}`"
    run = parts[part]
    absent = [name for name in names if not run.values.get(name)]
    if not absent:
        return ""
    known = next((run.missing[name] for name in absent if name in run.missing), "")
    return f"not measured: {known or run.left_out.get('all of it') or f'not part of the run of {run.began}'}"


def spread(rounds: Sequence[float], unit: str = "") -> str:
    """Return the least and the largest of several rounds, and their number.

    Examples
    --------
    >>> spread([1.5, 1.25, 2.0]), spread([1.5, 2.0], " s"), spread([3.0])
    ('1.25 to 2 (3)', '1.5 to 2 s (2)', '(1)')
    """
    if len(rounds) < 2:
        return f"({len(rounds)})"
    return f"{min(rounds):.3g} to {max(rounds):.3g}{unit} ({len(rounds)})"


def seconds_in_words(seconds: float) -> str:
    """Return a time (s) of three digits in a fitting unit.

    Examples
    --------
    >>> seconds_in_words(0.00342), seconds_in_words(2.31), seconds_in_words(1.2e-5)
    ('3.42 ms', '2.31 s', '12 µs')
    """
    if seconds >= 0.1:
        return f"{seconds:.3g} s"
    return f"{1e3 * seconds:.3g} ms" if seconds >= 1e-4 else f"{1e6 * seconds:.3g} µs"
