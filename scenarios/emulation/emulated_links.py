"""The emulated links in front of one core: netem's receiver, and what befalls the processes at both ends."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from netem.receiver import Arrival, Receiver
from netem.spec.change import Change, schedule_of
from netem.spec.fault import Fault
from netem.spec.node_fault import NodeFault
from netem.spec.pattern import Link, links_among, parse
from scenarios.emulation.emulation_config import Setup
from scenarios.emulation.link_command import LinkCommand
from scenarios.emulation.link_descriptions import words
from scenarios.emulation.link_reports import LinkStand, encode_stands, parts
from wire.messages import PLANT


class _Spell(NamedTuple):
    """A time in which an agent does not work, or works slowly (s of run time)."""

    since: float
    until: float
    slow: float
    """By how much longer it computes (s); infinite while it is paused."""


class EmulatedLinks:
    """All links into one receiver; `wire.links.Links` says what the core wants of it.

    Parameters
    ----------
    name : str
        The receiver: an inverter, or the plant.
    setup : Setup
        The run's faults.
    """

    def __init__(self, name: str, setup: Setup) -> None:
        self._name, self._microgrids, self._setup = name, setup.microgrids, setup
        self._senders = tuple(src for src in (*setup.microgrids, PLANT) if src != name)
        self.clear: set[str] = set()
        """Senders whose messages `offer` is known not to take."""
        self._dropped_before = 0
        self._begin()
        self._spells: dict[str, list[_Spell]] = {}
        self._paused: Counter[str] = Counter()
        """Messages of each sender that it never sent, as it was paused: only the lock-step needed them."""
        for node in setup.netem.nodes:
            if node.slow_s or (node.pause and not setup.real_nodes):
                self._spells.setdefault(node.name, []).append(_spell(node))

    def offer(self, src: str, seq: int, t: float, at: float, payload: bytes) -> bool:
        """Take a message off the wire, unless nothing ever happens to those from there; see `Receiver.offer`."""
        if not (src in self._spells or self._name in self._spells or self._receiver.touched(src)):
            self.clear.add(src)
            return False
        for spell in self._spells.get(src, ()):
            if spell.since <= t < spell.until:
                if math.isinf(spell.slow):
                    self._paused[src] += 1
                    return True
                at += spell.slow
        for spell in self._spells.get(self._name, ()):
            if spell.since <= t < spell.until and math.isinf(spell.slow):
                at += spell.until - t
        self._receiver.offer(src, seq, t, at, payload)
        return True

    @property
    def dropped(self) -> int:
        """Messages that were lost here, since the process began: a restart does not bring them back."""
        return self._dropped_before + self._receiver.dropped

    def due(self, now: float) -> Sequence[Arrival]:
        """Take out what has arrived by now (s of run time)."""
        return self._receiver.due(now)

    def stalled(self, t: float) -> bool:
        """Whether the receiver itself is paused at t (s of run time)."""
        if not self._spells:
            return False
        spells = self._spells.get(self._name, ())
        return any(spell.since <= t < spell.until and math.isinf(spell.slow) for spell in spells)

    def order(self, text: str, t: float) -> str:
        """Do what a person ordered, from t on (s of run time); who is concerned, or nothing.

        Raises
        ------
        ValueError
            If it is no order.
        """
        order = LinkCommand.of_text(text)
        change = order.at(t)
        links = [link.src for link in self._concerned(order, t) if link.dst == self._name]
        self._changes.append(change)
        if not links:
            return ""
        self.clear.clear()
        if isinstance(change, Fault):
            self._receiver.change(change, t)
        else:
            self._receiver.heal(change.on, t, change.kinds)
        return f"{', '.join(links)} -> {self._name}"

    def told(self, text: str, t: float) -> tuple[str, tuple[str, ...]]:
        """Say an order that is to hold from t on in words, and who receives over links that it changes.

        Raises
        ------
        ValueError
            If it is no order, or has mistakes.
        """
        order = LinkCommand.of_text(text)
        mistakes = order.mistakes(self._microgrids)
        if mistakes:
            raise ValueError("; ".join(f"{path}: {what}" for path, what in mistakes))
        links = self._concerned(order, t)
        return order.in_words(links), tuple(dict.fromkeys(link.dst for link in links))

    def _concerned(self, order: LinkCommand, t: float) -> list[Link]:
        """Links of the whole run that an order changes at t (s of run time): a heal those that have a fault then."""
        pattern, netem = parse(order.on), self._setup.netem
        links = [link for link in links_among(self._microgrids) if pattern.matches(*link, self._microgrids)]
        if order.fault is not None:
            return links
        schedules = {link: schedule_of(link, netem, self._changes, self._microgrids) for link in links}
        return [link for link in links if schedules[link].at(t).active]

    def impaired(self, t: float) -> tuple[str, ...]:
        """From whom links have a fault at t (s of run time)."""
        return tuple(src for src in self._senders if self._receiver.holding(src, t))

    def standing(self, t: float) -> bytes:
        """How the links stand at t (s of run time) that do something, or once did: `LinkStand` of each sender."""
        counts, stands = self._receiver.counts(), {}
        for src in self._senders:
            if self._receiver.was_impaired(src, t):
                holds = tuple(words(kind, span.model) for kind, span in self._receiver.holding(src, t).items())
                stands[src] = LinkStand(holds=holds, counts=counts.get(src))
        return encode_stands(stands)

    def restart(self) -> None:
        """Begin anew with what the scenario says: the run's time starts from 0 again."""
        self._dropped_before = self.dropped
        self._begin()

    def _begin(self) -> None:
        setup = self._setup
        self.clear.clear()
        self._changes: list[Change] = []
        """What was ordered so far, whomever it concerns."""
        self._receiver = Receiver(self._name, setup.netem, setup.microgrids, keep_trace=setup.keep_trace)

    def report(self, *, last: bool = False) -> tuple[bytes, ...]:
        """Take out what the links did since last asked, as parts of a `LinkBook`; none if nothing was ever judged."""
        receiver, counts = self._receiver, self._receiver.counts()
        if not last and not any(book.sent for book in counts.values()):
            return ()
        return parts(receiver.take_trace(), counts, receiver.trace_sha256, receiver.take_failures())


def _spell(node: NodeFault) -> _Spell:
    return _Spell(node.from_s, math.inf if node.to_s is None else node.to_s, math.inf if node.pause else node.slow_s)


def links_of(name: str, text: str) -> EmulatedLinks | None:
    """The links of a process, as its configuration says; None if it says nothing of any."""
    return EmulatedLinks(name, Setup.of_text(text)) if text else None
