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
from scenarios.emulation.link_reports import LinkStatus, encode_statuses, parts
from wire.links import CommandEffect
from wire.messages import PLANT, Measurement, State


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

    def offer(self, message: State | Measurement, payload: bytes, at: float) -> bool:
        """Take a message off the wire and return True; return False if no fault ever acts on its link."""
        src, t = message.sender, message.t
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
        self._receiver.offer(src, message.seq, t, at, payload, message)
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

    def command(self, text: str, t: float) -> CommandEffect:
        """Change what the links do to messages sent at t (s of run time) or later.

        Raises
        ------
        ValueError
            If the text is no command to links, or its values are wrong; nothing has changed then.
        """
        command = LinkCommand.of_text(text)
        mistakes = command.mistakes(self._microgrids)
        if mistakes:
            raise ValueError("; ".join(f"{path}: {what}" for path, what in mistakes))
        links, change = self._concerned(command, t), command.at(t)
        senders = [link.src for link in links if link.dst == self._name]
        self._changes.append(change)
        if senders:
            self.clear.clear()
            if isinstance(change, Fault):
                self._receiver.change(change, t)
            else:
                self._receiver.heal(change.on, t, change.kinds)
        return CommandEffect(
            text=command.in_words(links),
            receivers=tuple(dict.fromkeys(link.dst for link in links)),
            changed=f"{', '.join(senders)} -> {self._name}" if senders else "",
        )

    def _concerned(self, command: LinkCommand, t: float) -> list[Link]:
        """Return the links of the whole run that a command changes at t (s); a heal changes those that have a fault."""
        pattern, netem = parse(command.on), self._setup.netem
        links = [link for link in links_among(self._microgrids) if pattern.matches(*link, self._microgrids)]
        if command.fault is not None:
            return links
        schedules = {link: schedule_of(link, netem, self._changes, self._microgrids) for link in links}
        return [link for link in links if schedules[link].at(t).active]

    def impaired(self, t: float) -> tuple[str, ...]:
        """From whom links have a fault at t (s of run time)."""
        return tuple(src for src in self._senders if self._receiver.holding(src, t))

    def status(self, t: float) -> bytes:
        """Return the `LinkStatus` at t (s of run time) of each link, by sender, that has or had a fault."""
        counts, statuses = self._receiver.counts(), {}
        for src in self._senders:
            if self._receiver.was_impaired(src, t):
                holds = tuple(words(kind, span.model) for kind, span in self._receiver.holding(src, t).items())
                statuses[src] = LinkStatus(holds=holds, counts=counts.get(src))
        return encode_statuses(statuses)

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
