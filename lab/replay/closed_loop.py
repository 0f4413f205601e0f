"""A run in real time again, as a closed loop: each process hears the messages of the others in the replay.

Calls and arrivals come when they came in the record. So without a change every process does what it did. Under a change
a message takes as long as that of its number took in the record, and one that was lost stays lost. A message that the
record does not have takes a delay of its link (`LinkDelays`). Processes start, stop, freeze and die as they did, and
the commands of people to the plant happen again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent_config import nameplate_of
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.carriers.law_registry import close_laws
from gridpeers.agents.graphs import in_neighbours, rule_of
from gridpeers.agents.laws.law import Law
from gridpeers.lab.replay.changes import ChangedRule, Changes
from gridpeers.lab.replay.recorded_process import (
    KeyedMessage,
    MakePlant,
    RecordedProcess,
    RecordedStep,
    ReplayedProcess,
    ReplayError,
    agent_again,
    made_here,
    plant_again,
    processes_of,
    recorded_links,
    start_plant_of,
    tick_message,
)
from gridpeers.netem.schema.fault import Fault
from gridpeers.plant.plant_node import PlantNode
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.emulation.link_data import LinkCommand
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.codec import decode
from gridpeers.wire.journal import (
    EACH_TICK,
    TO_LINKS,
    MessageReference,
    ProcessEvent,
    ReceivedMessage,
    SentMessage,
    WakeUp,
    kind_of,
    name_of,
    sender_of,
    stream_of,
)
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, LinkReport, Measurement, State, Telemetry

MOST_SENT = 100_000

KEPT_DELAYS, KEPT_STATUSES = 1000, 16
"""Latest delays of a link, and latest statuses of an agent, that are kept: one may be some seconds on its way."""

CUT_OFF = 1.0
"""Time (s of real time) before the end of a record that is cut off within which a process belongs to its end."""

_CALL, _ARRIVAL = 0, 1  # Order of calls at the same time: processes that share a session send before they hear

_NOT_YET = KeyedMessage("", b"not yet")


class LoopProcess:
    def __init__(self, recorded: RecordedProcess) -> None:
        self.recorded, self.name = recorded, recorded.name
        self.again: ReplayedProcess | None = None
        self._steps: Iterator[RecordedStep] = recorded.steps()
        self.head: RecordedStep | None = next(self._steps, None)
        self._sent: dict[str, int] = {}

    @property
    def agent(self) -> AgentNode | None:
        return self.again.node if self.again is not None and isinstance(self.again.node, AgentNode) else None

    def next(self) -> None:
        assert self.head is not None
        for sent in self.head.sent:
            if (message := tick_message(sent)) is not None:
                self._sent[stream_of(sent.key)] = message.seq
        self.head = next(self._steps, None)

    def has_sent(self, of: str, number: int) -> bool:
        """Return whether it has sent a number of a stream, or a later one, in the record by now."""
        return self._sent.get(of, -1) >= number

    def hears(self, key: str) -> bool:
        return self.again is not None and self.again.hears(key)


class ClosedLoop:
    """A run again, from its start, under changes from a time on; None changes nothing."""

    def __init__(
        self,
        record: RunRecord,
        rule: ChangedRule | None,
        take: Callable[[Telemetry | LinkReport], None],
        make_plant: MakePlant,
    ) -> None:
        self._record, self._take, self._make_plant = record, take, make_plant
        self._changes = Changes() if rule is None else rule.changes
        self._control, self._netem = (None, None) if rule is None else (rule.control, rule.links)
        self._changed = bool(self._changes) and self._changes.since <= 0.0
        self._laws: list[Law] = []
        self._processes: dict[tuple[str, int], LoopProcess] = {}
        self._due: list[tuple[float, int, int, LoopProcess, KeyedMessage | None]] = []
        """What comes next: time (s, monotonic), calls first; process; the message if the record does not have it."""
        self._order = count()
        self._sent: dict[tuple[str, int, int], tuple[float, KeyedMessage]] = {}
        """Messages that were sent in the replay, by stream, epoch and number, and when."""
        self._delays = LinkDelays()
        self._statuses: dict[str, deque[KeyedMessage]] = {}
        self._listens = _listeners(record)
        self._number = -1
        self._t = 0.0
        self.notes: list[str] = []

    def run(self) -> None:
        info = self._record.info
        found = [LoopProcess(process) for process in processes_of(self._record)]
        first = found[0]
        if first.name != PLANT:
            raise ReplayError(f"{self._record.path}: the plant kept no journal, so the loop cannot be closed")
        plant = start_plant_of(info, self._make_plant)
        try:
            first.again = plant_again(first.recorded, info, plant, self._links(PLANT, info.plant.links))
            for process in found:
                self._processes[process.name, process.recorded.epoch] = process
                self._push(process)
            assert isinstance(first.again.node, PlantNode)
            self._loop(first.again.node, self._until(found))
            for process in found:
                if process.again is not None:
                    self._publish(process, (), process.again.end(), inf)
        finally:
            close_laws(self._laws)
            plant.close()

    def _until(self, found: list[LoopProcess]) -> float:
        record = self._record
        if record.complete:
            return inf
        end = record.t_end - CUT_OFF * max(1.0, record.info.plant.speed)
        return min((each.recorded.last_t for each in found if each.recorded.last_t >= end), default=inf)

    # ---------------------------------------------------------------- the loop

    def _loop(self, plant: PlantNode, until: float) -> None:
        waits = 0
        while self._due:
            due, _, _, process, message = heappop(self._due)
            if message is not None:
                if process.again is not None and process.again.hears(message.key):
                    self._publish(process, (), process.again.hear(message, due), due)
                continue
            step = process.head
            assert step is not None
            if process.name == PLANT:
                self._change_if_due(plant, step)
            self._t = plant.stepper.t
            if self._t > until + 1e-9:
                return
            heard = self._heard(process, step)
            if heard is _NOT_YET and self._due and waits <= len(self._due):
                waits += 1  # clocks of two hosts differ
                heappush(self._due, (self._due[0][0], _ARRIVAL, next(self._order), process, None))
                continue
            waits = 0
            if process.again is None:
                self._make_agent(process, step)
            if process.again is not None and (heard not in (None, _NOT_YET) or not step.is_arrival):
                self._publish(process, step.sent, process.again.take(step, heard), step.due)
            process.next()
            self._settle(process, step)
            self._push(process)

    def _push(self, process: LoopProcess) -> None:
        if process.head is not None:
            rank = _ARRIVAL if process.head.is_arrival else _CALL
            heappush(self._due, (process.head.due, rank, next(self._order), process, None))

    def _make_agent(self, process: LoopProcess, step: RecordedStep) -> None:
        config = self._record.info.agent(process.name)
        if config is None or not step.instance:
            self._note(f"the record lacks the start of {process.name}; its states stay as recorded")
            return
        if self._control is not None:
            config = replace(config, control=self._control)
        links = self._links(process.name, config.links)
        process.again = agent_again(process.recorded, config, step.instance, self._laws, links)

    def _links(self, name: str, recorded: dict[str, Any]) -> Links | None:
        if self._netem is None or not (recorded or self._changed):
            return recorded_links(self._record.info, name)
        return links_of(name, self._netem)

    def _settle(self, process: LoopProcess, step: RecordedStep) -> None:
        again = process.again
        commanded = isinstance(step.entry, ReceivedMessage) and kind_of(step.entry.key) in TO_LINKS
        if commanded and self._changed and again is not None and again.links is not None:
            for pattern in self._changes.without:  # the command may have healed them
                cut = LinkCommand(fault=Fault(on=pattern, cut=True))
                again.links.command(cut.to_tree(), max(self._t, self._changes.since))
        node, head = process.agent, process.head
        if node is None or head is None or not node.session_broken:
            return
        if not (isinstance(head.entry, ProcessEvent) and head.entry.kind == "session"):
            node.session_broken = node.post.closed = False
            self._note(f"{process.name} would have opened a new session; the effect is not known")

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

    # ---------------------------------------------------------------- the change

    def _change_if_due(self, plant: PlantNode, step: RecordedStep) -> None:
        if self._changed or not self._changes or not isinstance(step.entry, WakeUp) or step.entry.work:
            return
        if plant.phase != "running" or plant.stepper.t < self._changes.since - 1e-9:
            return
        self._changed = True
        for process in self._processes.values():
            again = process.again
            if again is None or again.node.finished:
                continue
            if self._netem is not None and again.links is None:
                links = links_of(process.name, self._netem)
                assert links is not None
                again.use_links(links)

    # ---------------------------------------------------------------- messages

    def _heard(self, process: LoopProcess, step: RecordedStep) -> KeyedMessage | None:
        entry = step.entry
        if not isinstance(entry, MessageReference | ReceivedMessage):
            return None
        recorded, kind = process.recorded.message, kind_of(entry.key)
        if kind not in EACH_TICK:
            message = recorded(step)
            if message is None or entry.rejected:
                return message
            if kind == "status":
                sent = self._statuses.get(message.key)  # without a change, the status of the record is among them
                return message if not sent or message in sent else sent[-1]
            return message
        named = _named(step)
        if named is None:  # no sound message
            return recorded(step)
        src, of, epoch, number = named
        found, by = self._sent.get((of, epoch, number)), self._processes.get((src, epoch))
        if found is not None:
            at, message = found
            self._delays.note(src, process.name, max(0.0, step.due - at))
            stays = process.name == PLANT or message.key == entry.key
            return message if stays else None  # a state that its law does not tell the neighbours
        if by is None or by.again is None:
            return recorded(step)
        if by.has_sent(of, number):
            return None  # the record has it, and the replay does not
        return recorded(step) if by.head is None else _NOT_YET

    def _publish(
        self, process: LoopProcess, recorded: tuple[SentMessage, ...], sent: list[KeyedMessage], due: float
    ) -> None:
        theirs = {(each.key, state.seq) for each in recorded if (state := tick_message(each)) is not None}
        for message in sent:
            kind = kind_of(message.key)
            if kind in ("telemetry", "report"):
                told = decode(message.payload)
                if isinstance(told, Telemetry):
                    if told.seq <= self._number:
                        continue  # again, for a late recorder
                    self._number = told.seq
                if isinstance(told, Telemetry | LinkReport):
                    self._take(told)
            elif (decoded := tick_message(message)) is not None:
                self._sent[stream_of(message.key), decoded.epoch, decoded.seq] = due, message
                if len(self._sent) > MOST_SENT:
                    del self._sent[next(iter(self._sent))]
                self._send_new(process, message, decoded, theirs, due)
            elif kind == "status":
                self._statuses.setdefault(message.key, deque(maxlen=KEPT_STATUSES)).append(message)

    def _send_new(
        self,
        process: LoopProcess,
        message: KeyedMessage,
        decoded: State | Measurement,
        theirs: set[tuple[str, int]],
        due: float,
    ) -> None:
        """Send a message to those for whom the record has none of its number, by delays of the link."""
        kind, name = kind_of(message.key), name_of(message.key)
        existed = (message.key, decoded.seq) in theirs
        any_state = any((f"{key}/{name}", decoded.seq) in theirs for key in ("state", "set_points"))
        for other in self._processes.values():
            if other is process or not other.hears(message.key):
                continue
            listened = kind == "measurement" or name in self._listens.get(other.name, frozenset())
            if not (any_state if other.name == PLANT else existed and listened):
                at = due + self._delays.draw(process.name, other.name)
                heappush(self._due, (at, _ARRIVAL, next(self._order), other, message))


def _listeners(record: RunRecord) -> dict[str, frozenset[str]]:
    nameplates = {config.name: nameplate_of(config) for config in record.info.agents}
    found = {}
    for config in record.info.agents:
        with made_here(f"{config.name}: its graph cannot be loaded here"):
            names = in_neighbours(config.control, config.name, nameplates, rule_of(config.control))
        found[config.name] = frozenset(names)
    return found


def _named(step: RecordedStep) -> tuple[str, str, int, int] | None:
    """Return sender, stream, epoch and number of a state, or a measurement, that arrives; None if none does."""
    entry = step.entry
    if not isinstance(entry, MessageReference | ReceivedMessage) or kind_of(entry.key) not in EACH_TICK:
        return None
    named = entry if isinstance(entry, MessageReference) else tick_message(entry)
    return None if named is None else (sender_of(entry.key), stream_of(entry.key), named.epoch, named.seq)


class LinkDelays:
    """Delays of messages (s of real time) by sender and receiver, as they are met, for messages that the record lacks.

    A link on which nothing was heard takes those of the other links to its receiver.
    """

    def __init__(self) -> None:
        self._delays: dict[tuple[str, str], deque[float]] = {}
        self._drawn: dict[tuple[str, str], int] = {}

    def note(self, src: str, dst: str, delay: float) -> None:
        self._delays.setdefault((src, dst), deque(maxlen=KEPT_DELAYS)).append(delay)

    def draw(self, src: str, dst: str) -> float:
        known = self._known(src, dst)
        number = self._drawn[src, dst] = self._drawn.get((src, dst), -1) + 1
        return known[number % len(known)]

    def _known(self, src: str, dst: str) -> list[float]:
        of_others = (delay for (_, to), known in self._delays.items() if to == dst for delay in known)
        return list(self._delays.get((src, dst), ())) or list(of_others) or [0.0]
