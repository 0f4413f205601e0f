"""The emulated links in front of one node: netem's receiver, and pauses and slow computers at both ends."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Container, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import replace

from gridpeers.netem.fault_schedule import LinkSchedules
from gridpeers.netem.ledger import LinkCounts
from gridpeers.netem.liar import HeardFrom, LiveHearing, lies_about
from gridpeers.netem.models import INSTANT
from gridpeers.netem.models.lie import lie_in_words
from gridpeers.netem.receiver import Receiver
from gridpeers.netem.schema.netem import NodeFault
from gridpeers.netem.schema.pattern import links_among, parse
from gridpeers.scenarios.emulation.link_data import EmulationConfig, LinkCommand, LinkStatus, report_data, words
from gridpeers.wire.links import Arrival, CommandEffect
from gridpeers.wire.messages import PLANT, Measurement, State


class _Interval(NamedTuple):
    """A time (s of run time) in which an agent does not work, or works slowly."""

    since: float
    until: float
    slow: float
    """Time (s) by which it computes longer; infinite while it is paused."""

    def holds(self, t: float) -> bool:
        return self.since <= t < self.until


class _Times:
    """The times (s of run time) within any of some intervals."""

    def __init__(self, intervals: Sequence[_Interval]) -> None:
        self._intervals = intervals

    def __contains__(self, t: object) -> bool:
        return isinstance(t, int | float) and any(at.holds(t) for at in self._intervals)


class EmulatedLinks:
    """All links (`gridpeers.wire.links.Links`) into one inverter or the plant, with the faults of their nodes."""

    def __init__(self, name: str, config: EmulationConfig) -> None:
        self._name, self._microgrids, self._config = name, config.microgrids, config
        self._senders = tuple(src for src in (*config.microgrids, PLANT) if src != name)
        self.clear: set[str] = set()
        """Senders whose messages `offer` is known not to take."""
        self._faulty: set[str] = set()
        """Senders whose messages `offer` is known to take."""
        self._dropped_before = 0
        self._lies: Counter[str] = Counter()
        """States that say something else here than their sender has decided, by sender."""
        self._intervals: dict[str, list[_Interval]] = {}
        for node in config.netem.nodes:
            if node.slow_s or (node.pause and not config.real_nodes):
                end, slow = math.inf if node.to_s is None else node.to_s, math.inf if node.pause else node.slow_s
                self._intervals.setdefault(node.name, []).append(_Interval(node.from_s, end, slow))
        pauses = tuple(at for at in self._intervals.get(name, ()) if math.isinf(at.slow))
        self.pauses: Container[float] = _Times(pauses) if pauses else frozenset[float]()
        """Times (s of run time) at which the receiver is paused."""
        self._begin()

    def offer(self, message: State | Measurement, payload: bytes, at: float) -> bool:
        """Take a message off the wire and return True; return False if no fault ever acts on its link."""
        src, t = message.sender, message.t
        if src not in self._faulty:
            known = src in self._intervals or self._name in self._intervals or src in self._liars
            if not (known or self._receiver.touched(src)):
                self.clear.add(src)
                return False
            self._faulty.add(src)
        for interval in self._intervals.get(src, ()):
            if interval.holds(t):
                if math.isinf(interval.slow):  # a paused agent sends nothing: only the lock-step needed its message
                    return True
                at += interval.slow
        if src in self._liars and type(message) is State:
            told = self._liars[src].told(message)
            if told is not message and told != message:
                self._lies[src] += 1
            message = told
        self._receiver.offer(src, message.seq, t, at, payload, message)
        return True

    @property
    def dropped(self) -> int:
        """Number of messages lost here since the process began, restarts included."""
        return self._dropped_before + self._receiver.dropped

    def _due_unless_paused(self, now: float) -> Sequence[Arrival]:
        return () if now in self.pauses else self._receiver.due(now)

    def command(self, tree: Mapping[str, Any], t: float) -> CommandEffect:
        """Change what the links do to messages sent from t (s of run time) on; ValueError if the command is wrong."""
        command = LinkCommand.of_tree(tree)
        problems = command.problems(self._microgrids)
        if problems:
            raise ValueError("; ".join(f"{path}: {what}" for path, what in problems))
        pattern, change = parse(command.on), command.at(t)
        links = [link for link in links_among(self._microgrids) if pattern.matches(*link, self._microgrids)]
        if command.fault is None:  # a heal changes the links that have a fault
            links = [link for link in links if self._schedules.of(link).at(t).active]
        senders = [link.src for link in links if link.dst == self._name]
        self._receiver.apply(change)
        self._schedules.apply(change)
        self._faulty.clear()
        if senders:
            self.clear.clear()
        return CommandEffect(
            text=command.in_words(links),
            receivers=tuple(dict.fromkeys(link.dst for link in links)),
            changed=f"{', '.join(senders)} -> {self._name}" if senders else "",
        )

    def impaired(self, t: float) -> tuple[str, ...]:
        return tuple(src for src in self._senders if self._receiver.holding(src, t))

    def status(self, t: float) -> bytes:
        """Return the `LinkStatus` at t (s of run time) of each link, by sender, that has or had a fault."""
        counts, statuses = self._counts(), {}
        for src in self._senders:
            if self._receiver.was_impaired(src, t):
                holds = tuple(words(kind, span.model) for kind, span in self._receiver.holding(src, t).items())
                statuses[src] = LinkStatus(holds=holds, counts=counts.get(src))
        return msgspec.msgpack.encode(statuses)

    def _counts(self) -> dict[str, LinkCounts]:
        counts = self._receiver.counts()
        return counts | {src: replace(counts[src], lies=lies) for src, lies in self._lies.items()}

    def restart(self) -> None:
        """Forget all commands and all messages on their way: the run's time starts from 0 again."""
        self._dropped_before = self.dropped
        self._begin()

    def _begin(self) -> None:
        config = self._config
        self.clear.clear()
        self._faulty.clear()
        self._receiver = Receiver(self._name, config.netem, config.microgrids, keep_trace=config.keep_trace)
        self.due = self._due_unless_paused if self.pauses else self._receiver.due
        """Take out what has arrived by now (s of run time): a paused receiver takes it when it goes on."""
        self._schedules = LinkSchedules(config.netem, config.microgrids)
        self._lies.clear()
        self._liars = {  # senders whose states are lies here at some time
            src: LiveHearing(HeardFrom(config.netem.seed, src, self._name, lies))
            for src in self._senders
            if (lies := lies_about(config.netem, src, self._name))
        }
        self._node_events = _events_of(config.netem.nodes)

    def node_events(self, t: float) -> tuple[tuple[str, str], ...]:
        """Take out what liars began or ended by t (s of run time): the agent and a sentence each."""
        due = [event for event in self._node_events if event[0] <= t + INSTANT]
        del self._node_events[: len(due)]
        return tuple((name, text) for _, name, text in due)

    def report(self, *, last: bool = False) -> tuple[bytes, ...]:
        """Take out what the links did since the last report, as encoded `LinkReportData`; the last is never empty."""
        receiver, counts = self._receiver, self._counts()
        if not last and not any(book.sent for book in counts.values()):
            return ()
        return report_data(receiver.take_trace(), counts, receiver.trace_sha256, receiver.take_failures())


def _events_of(nodes: Sequence[NodeFault]) -> list[tuple[float, str, str]]:
    found = []
    for node in nodes:
        if node.lies is not None:
            found.append((node.from_s, node.name, f"{node.name} begins to lie: {lie_in_words(node.lies)}"))
            if node.to_s is not None:
                found.append((node.to_s, node.name, f"{node.name} tells the truth again"))
    return sorted(found)


def links_of(name: str, tree: Mapping[str, Any]) -> EmulatedLinks | None:
    return EmulatedLinks(name, EmulationConfig.of_tree(tree)) if tree else None
