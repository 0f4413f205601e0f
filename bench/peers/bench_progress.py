"""The progress of the bench: what is measured now, how long it usually takes, and what is left."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console

from bench.peers.measured import Measure
from bench.peers.parts import PARTS, Extent
from bench.peers.stored import Parts
from gridpeers.cli.remaining import Tell, remaining
from scenarios.duration import duration


class Progress(Protocol):
    """Takes the progress."""

    def tell(self, part: str, text: str, measure: Measure) -> None:
        """Tell what begins."""

    def done(self, part: str) -> None:
        """Tell that a part is done."""


def usual_seconds(parts: Parts, name: str, rounds: int) -> float:
    """Return how long so many rounds of a part usually take (s): as when last measured, or on an idle machine."""
    if name in parts and parts[name].seconds and (before := len(parts[name].loads) - 1):
        return parts[name].seconds * rounds / before
    return PARTS[name].usual * rounds / Extent().rounds


def usual_text(usual: Mapping[str, float]) -> str:
    """Return what is to come, for the start: each part with its usual duration (s), and the sum."""
    lines = [f"  {name:9}{PARTS[name].text:84}{duration(round(seconds)):>8}" for name, seconds in usual.items()]
    parts = f"{len(usual)} part{'' if len(usual) == 1 else 's'}"
    return "\n".join([f"{parts}, usually {duration(round(sum(usual.values())))}:", *lines])


@contextmanager
def progress(console: Console, usual: Mapping[str, float], took: Parts) -> Iterator[Progress]:
    """Show a bar on a terminal, and lines elsewhere.

    Parameters
    ----------
    console
        Where to.
    usual
        The parts that are to be measured, in this order, and the usual duration (s) of each.
    took
        Earlier measurements, for the usual duration of each measure.
    """
    with remaining(console, max(sum(usual.values()), 1.0)) as tell:
        yield _Shown(tell, usual, took)


class _Shown:
    def __init__(self, tell: Tell, usual: Mapping[str, float], took: Parts) -> None:
        self._tell, self._usual, self._took = tell, usual, took
        self._spent = dict.fromkeys(usual, 0.0)
        self._tell("starting", 0.0)

    def tell(self, part: str, text: str, measure: Measure) -> None:
        """Tell what begins; a part whose measures take longer than usual stays below its end."""
        seconds = self._took[part].took.get(measure.name) if part in self._took else None
        number = list(self._usual).index(part) + 1
        usually = f", usually {duration(round(seconds + 0.5))}" if seconds else ""
        # off a terminal a line is printed for each new text before the comma: for each round, not for each measure
        self._tell(f"{part} ({number} of {len(self._usual)}) {text}, {measure.name}{usually}", self._done)
        self._spent[part] = min(self._usual[part], self._spent[part] + (seconds or 0.0))

    def done(self, part: str) -> None:
        """Tell that a part is done."""
        self._spent[part] = self._usual[part]

    @property
    def _done(self) -> float:
        return sum(self._spent.values())
