"""A user-defined fault: its base class, the registry of faults, and its judge.

A message meets it after loss and before the line's rate: it is dropped, or goes on, later by what `judge` returns.
docs/how-to/plug-ins.md has an example.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any, NamedTuple

import msgspec

from gridpeers.netem.draws import Stream
from gridpeers.wire.plugins.plugin import Plugin, class_objection, made
from gridpeers.wire.plugins.registry import ANYTHING, Registry, named
from gridpeers.wire.schema.table_reading import parameter_values
from gridpeers.wire.wording import printable

LONGEST = 3600.0  # Longest delay (s) that a fault may add
DROPPED_BY_OWN = "fault"  # Reason, in links.csv, of a message that a user-defined fault dropped


class LinkMessage(NamedTuple):
    """A message, as a fault gets it."""

    src: str
    """Sender: an inverter, or "plant"."""
    dst: str
    """Receiver."""
    seq: int
    """Number on this link, from 0: that of the tick."""
    t: float
    """Run time (s) at which it was sent."""
    size: int
    """Length (bytes)."""


class MessageDraws:
    """Random numbers of one message on one link for one fault, equal for every driver."""

    __slots__ = ("_seq", "_stream")

    def __init__(self, stream: Stream, seq: int) -> None:
        self._stream, self._seq = stream, seq

    def uniform(self, index: int = 0) -> float:
        """Return a number in the open interval (0, 1); another index is another number."""
        return self._stream.uniform(self._seq, index)

    def normal(self, index: int = 0) -> float:
        """Return a standard normal number."""
        return self._stream.normal(self._seq, index)

    def below(self, bound: int, index: int = 0) -> int:
        """Return a whole number from 0 to bound - 1."""
        return self._stream.below(bound, self._seq, index)


class LinkFault:
    """Base of all link faults of your own: derive from it, annotate the parameters, and write `judge`.

    Each entry has one object per link. `judge` should depend on the message and the draws alone, because a receiver
    that joins late does not see the messages before. A wrong parameter raises ValueError.
    """

    def __init__(self, **parameters: Any) -> None:
        for name, value in parameter_values(type(self), parameters).items():
            setattr(self, name, value)

    def judge(self, message: LinkMessage, draws: MessageDraws) -> float | None:
        """Return the added delay of a message (s, at least 0), or None for a lost one; only `draws` is random."""
        raise NotImplementedError


def _objection(it: Any) -> str:
    if isinstance(it, type) and issubclass(it, msgspec.Struct) and it.__module__.startswith("gridpeers.netem.models."):
        return ""
    return class_objection(it, LinkFault, "judge", ("message", "draws"))


FAULTS: Registry[Any] = Registry(
    "link fault",
    "link faults",
    _objection,
    own={
        "cut": "gridpeers.netem.models.medium:Cut",
        "flap": "gridpeers.netem.models.medium:Flap",
        "loss": "gridpeers.netem.models.loss:Bernoulli",
        "rate": "gridpeers.netem.models.medium:Rate",
        "slots": "gridpeers.netem.models.medium:Slots",
        "delay": "gridpeers.netem.models.delay:Constant",
        "duplicate": "gridpeers.netem.models.medium:Duplicate",
        "corrupt": "gridpeers.netem.models.medium:Corrupt",
    },
)
"""Faults by name; those of gridpeers come first, each by the model that a bare number means."""

Judge = Callable[[int, float, int], float | None]
"""From number, time (s) and size (bytes) of a message to its delay (s), None if it is lost."""


def judge_of(plugin: Plugin, src: str, dst: str, stream: Stream, tell: Callable[[str], None]) -> Judge:
    """Return the judge of a fault on one link; one that fails is reported, and does nothing from then on."""
    try:
        fault = made(FAULTS, plugin)
    except ValueError as error:
        tell(f"link fault {plugin.use} on {src} -> {dst} has no effect: {error}")
        return lambda seq, t, size: 0.0
    failed = False

    def judge(seq: int, t: float, size: int) -> float | None:
        nonlocal failed
        if failed:
            return 0.0
        why = ""
        try:
            added = fault.judge(LinkMessage(src, dst, seq, t, size), MessageDraws(stream, seq))
            if added is None:
                return None
            if not isinstance(added, bool) and isfinite(added) and 0.0 <= added <= LONGEST:
                return float(added)
            why = f"returned {printable(repr(added), 60)}; return a delay from 0 to {LONGEST:g} s, or None to drop"
        except ANYTHING as error:  # a fault is anybody's code
            why = f"raised {named(error)}"
        failed = True
        when = f"at t = {t:.6g} s, message {seq}"
        tell(f"link fault {plugin.use} on {src} -> {dst} {why} {when}; it does nothing from then on")
        return 0.0

    return judge
