"""A run in wall-clock time again, as a closed loop: what each process hears is what the others send in the replay.

Calls and arrivals come when they came in the record. So without a change every process does what it did. Under a change
a message takes as long as that of its number took in the record, and one that was lost stays lost. A message that the
record does not have takes a delay of its link (`LinkDelays`). Processes start, stop, freeze and die as they did, and
what people asked of the plant happens again.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from heapq import heappop, heappush
from itertools import count
from math import inf
from statistics import median

from gridpeers.agents.agent_config import nameplate_of
from gridpeers.agents.graphs import GraphError, in_neighbours, rule_of
from gridpeers.lab.replay.changes import ChangedRule
from gridpeers.lab.replay.loop_process import ChangedProcesses, LoopProcess, is_arrival
from gridpeers.lab.replay.recorded_process import Input, RecordedStep, ReplayError, processes_of
from gridpeers.lab.replay.replayed_process import MakePlant, Message, message_of, start_plant_of, tick_message
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
from gridpeers.wire.messages import PLANT, AnyMessage, LinkReport, Measurement, State, Telemetry

MOST_SENT = 100_000
"""Messages that are kept for those that are yet to hear them: minutes of nine agents."""

KEPT_DELAYS, KEPT_STATUSES = 1000, 16
"""Latest delays of a link, and latest statuses of an agent, that are kept: one may be some seconds on its way."""

CUT_OFF = 1.0
"""Time (s of wall time) before the end of a record that is cut off within which a process belongs to its end."""

_CALL, _ARRIVAL = 0, 1
"""Order of what is due at the same time: processes that share a session send before they hear."""

_NOT_YET = Message("", b"not yet")
"""In place of a message that its sender is yet to send."""


class ClosedLoop:
    """A run again, from its start, under changes from a time on."""

    def __init__(
        self,
        record: RunRecord,
        rule: ChangedRule | None,
        take: Callable[[Telemetry | LinkReport], None],
        make_plant: MakePlant,
    ) -> None:
        self._record, self._take, self._make_plant = record, take, make_plant
        self._making = ChangedProcesses(record.info, rule)
        self._processes: dict[tuple[str, int], LoopProcess] = {}
        self._due: list[tuple[float, int, int, LoopProcess, Message | None]] = []
        """What comes next: when (s, monotonic), calls first; of whom; the message, if the record has none of it."""
        self._order = count()
        self._sent: OrderedDict[tuple[str, int, int], tuple[float, Message]] = OrderedDict()
        """Messages that were sent in the replay, by stream, epoch and number, and when."""
        self._delays = LinkDelays()
        self._statuses: dict[str, deque[Message]] = {}
        """Latest statuses of each agent, by key."""
        self._listens = _listeners(record)
        self._lost = frozenset(_lost(record)) if rule is not None and rule.changes.without_loss else frozenset()
        self._number = -1
        """Number of the last telemetry."""
        self._t = 0.0
        """Run time of the plant (s)."""
        self.notes: list[str] = []
        """Sentences on what the replay leaves out."""

    def run(self) -> None:
        found = [LoopProcess(process) for process in processes_of(self._record)]
        first = found[0]
        if first.name != PLANT:
            raise ReplayError(f"{self._record.path}: the plant kept no journal, so that nothing can follow from it")
        until, plant = self._until(found), start_plant_of(self._record.info, self._make_plant)
        try:
            self._making.make_plant(first, plant)
            for process in found:
                self._processes[process.name, process.recorded.epoch] = process
                self._push(process)
            self._loop(first, until)
            for process in found:
                if process.again is not None:
                    self._publish(process, (), process.again.end(), inf)
        finally:
            self._making.close()
            plant.close()

    def _until(self, found: list[LoopProcess]) -> float:
        """Return the run time (s) up to which all journals of a record reach; infinite for a complete one."""
        record = self._record
        if record.complete:
            return inf
        end = record.t_end - CUT_OFF * max(1.0, record.info.plant.speed)
        return min((each.recorded.last_t for each in found if each.recorded.last_t >= end), default=inf)

    # ---------------------------------------------------------------- the loop

    def _loop(self, plant: LoopProcess, until: float) -> None:
        waits = 0
        while self._due:
            due, _, _, process, message = heappop(self._due)
            if message is not None:
                if process.again is not None and process.again.hears(message.key):
                    self._publish(process, (), process.again.hear(message, due), due)
                continue
            step = process.head
            assert step is not None
            self._change_if_due(process, step)
            self._t = plant.plant.t if plant.plant is not None else 0.0
            if self._t > until + 1e-9:
                return
            heard = self._heard(process, step)
            if heard is _NOT_YET and self._due and waits <= len(self._due):
                waits += 1  # clocks of two hosts differ
                heappush(self._due, (self._due[0][0], _ARRIVAL, next(self._order), process, None))
                continue
            waits = 0
            if process.again is None and not self._making.make_agent(process, step):
                self._note(f"the record lacks the start of {process.name}, so that its states are as recorded")
            if process.again is not None and (heard not in (None, _NOT_YET) or not is_arrival(step)):
                sent = process.again.take(step, heard)
                self._publish(process, step.sent, sent, step.due)
            process.next()
            self._settle(process, step)
            self._push(process)

    def _push(self, process: LoopProcess) -> None:
        if process.head is not None:
            rank = _ARRIVAL if is_arrival(process.head) else _CALL
            heappush(self._due, (process.head.due, rank, next(self._order), process, None))

    def _change_if_due(self, process: LoopProcess, step: RecordedStep) -> None:
        """Make the change before the plant measures at its time."""
        node, since = process.plant, self._making.is_due
        if since is None or node is None or not isinstance(step.entry, WakeUp) or step.entry.work:
            return
        if node.phase == "running" and node.t >= since - 1e-9:
            self._making.change(list(self._processes.values()))

    def _settle(self, process: LoopProcess, step: RecordedStep) -> None:
        """Undo what a step must not do to a process under the changes."""
        if isinstance(step.entry, ReceivedMessage) and kind_of(step.entry.key) in TO_LINKS:
            self._making.cut_again(process, self._t)
        node, head = process.agent, process.head
        if node is None or head is None or not node.session_broken:
            return
        if not (isinstance(head.entry, ProcessEvent) and head.entry.kind == "session"):
            node.session_broken = False
            self._note(f"{process.name} would have opened a new session; what that would have brought is not known")

    # ---------------------------------------------------------------- messages

    def _heard(self, process: LoopProcess, step: RecordedStep) -> Message | None:
        """Return what a process hears in a step: as the replay sent it, or as recorded where nobody sends it there."""
        entry = step.entry
        if not isinstance(entry, MessageReference | ReceivedMessage):
            return None
        kind = kind_of(entry.key)
        if kind not in EACH_TICK:
            recorded = message_of(process.recorded, step)
            if kind == "status" and recorded is not None and not entry.rejected:
                sent = self._statuses.get(recorded.key)  # without a change, the status of the record is among them
                return recorded if not sent or recorded in sent else sent[-1]
            is_command = kind in TO_LINKS and not entry.rejected
            return self._making.command(recorded) if is_command and recorded is not None else recorded
        named = _named(entry)
        if named is None:  # no sound message
            return message_of(process.recorded, step)
        src, of, epoch, number = named
        found, by = self._sent.get((of, epoch, number)), self._processes.get((src, epoch))
        if found is not None:
            at, message = found
            self._delays.note(src, process.name, max(0.0, step.due - at))
            stays = process.name == PLANT or message.key == entry.key
            return message if stays else None  # a state that its law does not tell the neighbours
        if by is None or by.again is None:
            return message_of(process.recorded, step)
        if by.has_sent(of, number):
            return None  # the record has it, and the replay does not
        return message_of(process.recorded, step) if by.head is None else _NOT_YET

    def _publish(
        self, process: LoopProcess, recorded: tuple[SentMessage, ...], sent: list[Message], due: float
    ) -> None:
        """Bring what a process sent in a step to those who hear it, beside those of whom the record has it."""
        theirs = {(each.key, state.seq) for each in recorded if (state := tick_message(each)) is not None}
        for message in sent:
            if kind_of(message.key) in ("telemetry", "report"):
                self._record_message(decode(message.payload))
            elif (decoded := tick_message(message)) is not None:
                self._sent[stream_of(message.key), decoded.epoch, decoded.seq] = due, message
                if len(self._sent) > MOST_SENT:
                    self._sent.popitem(last=False)
                self._send_new(process, message, decoded, theirs, due)
            elif kind_of(message.key) == "status":
                self._statuses.setdefault(message.key, deque(maxlen=KEPT_STATUSES)).append(message)

    def _send_new(
        self,
        process: LoopProcess,
        message: Message,
        decoded: State | Measurement,
        theirs: set[tuple[str, int]],
        due: float,
    ) -> None:
        """Send a message to those for whom the record has none of its number, by delays of the link."""
        kind, name = kind_of(message.key), name_of(message.key)
        existed = (message.key, decoded.seq) in theirs
        any_state = any((f"{key}/{name}", decoded.seq) in theirs for key in ("state", "set_points"))
        for other in self._processes.values():
            if other is process or other.again is None or not other.again.hears(message.key):
                continue
            link = process.name, other.name
            if (*link, decoded.epoch, decoded.seq) in self._lost and self._making.changed:
                self._deliver(other, message, due + self._delays.typical(*link))
                continue
            listened = kind == "measurement" or name in self._listens.get(other.name, frozenset())
            if not (any_state if other.name == PLANT else existed and listened):
                self._deliver(other, message, due + self._delays.draw(*link))

    def _deliver(self, to: LoopProcess, message: Message, due: float) -> None:
        heappush(self._due, (due, _ARRIVAL, next(self._order), to, message))

    def _record_message(self, message: AnyMessage) -> None:
        if isinstance(message, LinkReport):
            self._take(message)
        elif isinstance(message, Telemetry) and message.seq > self._number:  # not again for a late recorder
            self._number = message.seq
            self._take(message)

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def _listeners(record: RunRecord) -> dict[str, frozenset[str]]:
    """Return the in-neighbours of each agent in the record, if all agents were there."""
    nameplates = {config.name: nameplate_of(config) for config in record.info.agents}
    found = {}
    for config in record.info.agents:
        try:
            names = in_neighbours(config.control, config.name, nameplates, rule_of(config.control))
        except (GraphError, ValueError) as error:
            raise ReplayError(f"{config.name}: its graph cannot be made here: {error}") from None
        found[config.name] = frozenset(names)
    return found


def _named(entry: Input) -> tuple[str, str, int, int] | None:
    """Return sender, stream, epoch and number of a state, or a measurement, that arrives; None if none does."""
    if not isinstance(entry, MessageReference | ReceivedMessage) or kind_of(entry.key) not in EACH_TICK:
        return None
    named = entry if isinstance(entry, MessageReference) else tick_message(Message(entry.key, entry.payload))
    return None if named is None else (sender_of(entry.key), stream_of(entry.key), named.epoch, named.seq)


def _lost(record: RunRecord) -> Iterator[tuple[str, str, int, int]]:
    """Yield sender, receiver, epoch and number of messages that a receiver missed on the wire between two others."""
    for process in processes_of(record):
        last: dict[tuple[str, int], int] = {}
        for step in process.steps():
            if (named := _named(step.entry)) is not None:
                src, of, epoch, number = named
                before = last.get((of, epoch), number)
                yield from ((src, process.name, epoch, missed) for missed in range(before + 1, number))
                last[of, epoch] = max(before, number)


class LinkDelays:
    """Delays of messages (s of wall time) by sender and receiver, as they are met, for messages that the record lacks.

    A link on which nothing was heard takes those of the other links to its receiver.
    """

    def __init__(self) -> None:
        self._delays: dict[tuple[str, str], deque[float]] = {}
        self._drawn: dict[tuple[str, str], int] = {}

    def note(self, src: str, dst: str, delay: float) -> None:
        self._delays.setdefault((src, dst), deque(maxlen=KEPT_DELAYS)).append(delay)

    def draw(self, src: str, dst: str) -> float:
        """Return a delay: those of the link in their order, again and again."""
        known = self._known(src, dst)
        number = self._drawn[src, dst] = self._drawn.get((src, dst), -1) + 1
        return known[number % len(known)]

    def typical(self, src: str, dst: str) -> float:
        return median(self._known(src, dst))

    def _known(self, src: str, dst: str) -> list[float]:
        of_others = (delay for (_, to), known in self._delays.items() if to == dst for delay in known)
        return list(self._delays.get((src, dst), ())) or list(of_others) or [0.0]
