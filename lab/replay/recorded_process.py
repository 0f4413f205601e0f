"""The processes of a run in real time as their journals have them: each call of a node, and the messages it sent."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from math import inf
from typing import NamedTuple

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.agents.laws.law import Law
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.plant_node import PlantNode
from gridpeers.scenarios.drivers.telemetry_client import with_recorder
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.wire.codec import KINDS, encode, sound
from gridpeers.wire.journal import (
    EACH_TICK,
    Entry,
    JournalBuffer,
    MessageReference,
    ProcessEvent,
    ReceivedMessage,
    RejectedCount,
    SentMessage,
    Token,
    Traffic,
    WakeUp,
    kind_of,
)
from gridpeers.wire.keys import Keys
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, Journal, Measurement, State
from gridpeers.wire.node import Loss
from gridpeers.wire.wording import InputError

CALLS = ("start", "session", "leave")  # Kinds of process events that are calls of the node; the others say what it did

Input = Token | MessageReference | ReceivedMessage | RejectedCount | WakeUp | ProcessEvent


class ReplayError(InputError):
    """A record that cannot be replayed, or a change that cannot be made to it; each problem is one sentence."""

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class KeyedMessage(NamedTuple):
    """A message on its way; the key is without `gridpeers/<run>/`."""

    key: str
    payload: bytes


def tick_message(message: KeyedMessage | SentMessage | ReceivedMessage) -> State | Measurement | None:
    """Return a state, or a measurement; None of anything else."""
    decoded = sound(message.payload) if kind_of(message.key) in EACH_TICK else None
    return decoded if isinstance(decoded, State | Measurement) else None


class RecordedStep(NamedTuple):
    due: float
    """When it was called (s, monotonic): a message waits from its arrival until the calls before are done."""
    entry: Input
    sent: tuple[SentMessage, ...]
    t: float
    """Run time at which its journal was sent (s); 0 before the run begins."""
    last: bool = False
    """The journal ends with it, so that some of what it sent may be missing."""

    @property
    def is_arrival(self) -> bool:
        return isinstance(self.entry, MessageReference | ReceivedMessage)

    @property
    def instance(self) -> str:
        entry = self.entry
        return entry.text.rpartition(" ")[2] if isinstance(entry, ProcessEvent) and entry.kind == "start" else ""


class RecordedProcess:
    """One process of a run, by its name and epoch; its journal begins in a part of the file, and ends at `last_t`."""

    def __init__(self, parts: JournalParts, name: str, epoch: int, first: int, last_t: float) -> None:
        self._parts, self.name, self.epoch, self._first, self.last_t = parts, name, epoch, first, last_t
        self.ends = ""
        """Why its steps end before the process did; "" as far as that is not known."""

    def steps(self) -> Iterator[RecordedStep]:
        held: tuple[float, Input, float] | None = None
        sent: list[SentMessage] = []
        due = -inf
        for journal, entry in self._entries():
            if isinstance(entry, SentMessage):
                if kind_of(entry.key) in EACH_TICK:
                    sent.append(entry)
                continue
            if not isinstance(entry, Input) or (isinstance(entry, ProcessEvent) and entry.kind not in CALLS):
                continue
            if held is not None:
                yield RecordedStep(held[0], held[1], tuple(sent), held[2])
            due = max(due, -inf if entry.at is None else entry.at)
            held, sent = (due, entry, journal.t), []
        if held is not None:
            yield RecordedStep(held[0], held[1], tuple(sent), held[2], last=True)

    def _entries(self) -> Iterator[tuple[Journal, Entry]]:
        number = 0
        for index in range(self._first, self._parts.count):
            for journal, entries in self._parts.of(index).get((self.name, self.epoch), ()):
                if journal.seq < number:
                    continue
                if journal.seq > number:
                    missing = "begins" if number == 0 else f"lacks {journal.seq - number} of its parts"
                    self.ends = f"the journal of {self.name} {missing} at t = {journal.t:.2f} s"
                    return
                number = journal.seq + 1
                for entry in entries:
                    if isinstance(entry, ProcessEvent) and entry.kind == "lost":
                        self.ends = f"the journal of {self.name} was full at t = {journal.t:.2f} s: {entry.text}"
                        return
                    yield journal, entry

    def message(self, step: RecordedStep) -> KeyedMessage | None:
        """Return the message that it heard in a step; None if it heard none, or the record does not have it."""
        entry = step.entry
        if isinstance(entry, ReceivedMessage):
            return KeyedMessage(entry.key, entry.payload)
        if isinstance(entry, MessageReference):
            found = self._parts.index.named_by(entry, step.t)
            return None if found is None else KeyedMessage(entry.key, encode(found))
        return None


class JournalParts:
    def __init__(self, index: MessageIndex) -> None:
        self.index, self.count = index, index.parts
        self.of = lru_cache(maxsize=16)(self._of)

    def _of(self, number: int) -> dict[tuple[str, int], list[tuple[Journal, list[Entry]]]]:
        found: dict[tuple[str, int], list[tuple[Journal, list[Entry]]]] = {}
        for journal, entry in self.index.part(number).entries:
            parts = found.setdefault((journal.sender, journal.epoch), [])
            if not parts or parts[-1][0] is not journal:
                parts.append((journal, []))
            parts[-1][1].append(entry)
        return found

    def processes(self) -> Iterator[RecordedProcess]:
        first: dict[tuple[str, int], tuple[int, float]] = {}
        for number in range(self.count):
            for record in self.index.file.part(number):
                journal = sound(record.data) if record.topic == "journal" else None
                if isinstance(journal, Journal):
                    key = journal.sender, journal.epoch
                    first[key] = first.get(key, (number, 0.0))[0], journal.t
        for (name, epoch), (number, last_t) in first.items():
            yield RecordedProcess(self, name, epoch, number, last_t)


def processes_of(record: RunRecord) -> tuple[RecordedProcess, ...]:
    """Return the processes of a run in real time, the plant first."""
    require_arrivals(record)
    found = sorted(JournalParts(record.index).processes(), key=lambda each: each.name != PLANT)
    if not found:
        raise ReplayError(f"{record.path}: it ends before any process has noted its calls")
    return tuple(found)


def require_arrivals(record: RunRecord) -> None:
    level = record.info.level
    if level != "all":
        has = "the physics alone" if level == "physics" else "decisions, but not what else arrived and when"
        raise ReplayError(
            f'{record.path}: cannot be replayed: it was recorded with record = "{level}", so it has {has}; '
            'run it again with record = "all"'
        )


# -------------------------------------------------------------------- a process made again


MakePlant = Callable[[PlantConfig], PlantLike]


class _Outbox(Traffic):
    def __init__(self, keys: Keys) -> None:
        super().__init__(keys, JournalBuffer(), arrivals=False)
        self.messages: list[KeyedMessage] = []

    def sent(self, key: str, payload: bytes) -> None:
        self.messages.append(KeyedMessage(key[self._cut :], payload))


class ReplayedProcess:
    def __init__(self, node: AgentNode | PlantNode, links: Links | None) -> None:
        self.node, self.links = node, links
        self._root = node.keys.prefix
        self._sent = _Outbox(node.keys)
        node.post.traffic = self._sent

    def use_links(self, links: Links) -> None:
        self.links = links
        if isinstance(self.node, PlantNode):
            self.node.links = links
        else:
            self.node.heard.links = links

    def hears(self, key: str) -> bool:
        return self._root + key in self.node.routes and not self.node.finished

    def take(self, step: RecordedStep, message: KeyedMessage | None = None) -> list[KeyedMessage]:
        node, entry = self.node, step.entry
        at = entry.at or 0.0
        if isinstance(entry, RejectedCount):
            if entry.kind in KINDS:  # the record has their number alone
                node.lost(Loss(self._root + entry.key, entry.kind, "as recorded", entry.count), at)
        elif isinstance(entry, Token):
            (node.appeared if entry.appeared else node.vanished)(self._root + entry.key, at)
        elif isinstance(entry, WakeUp):
            (node.work if entry.work else node.expire)(entry.at)
        elif not isinstance(entry, ProcessEvent):
            assert message is not None
            return self.hear(message, at)
        elif entry.kind != "leave":
            if entry.kind == "session" and isinstance(node, AgentNode):
                node.session_broken = True  # also of an agent whose session was sound, but not that of its process
            node.start(at)
        elif isinstance(node, AgentNode):
            node.leave(entry.text)
        return self._take()

    def hear(self, message: KeyedMessage, at: float) -> list[KeyedMessage]:
        self.node.received(self._root + message.key, message.payload, at)
        return self._take()

    def end(self) -> list[KeyedMessage]:
        """Have a node whose journal ends before it does report the rest of its rows, or on its links; return that."""
        node = self.node
        if isinstance(node, AgentNode):
            node.leave("its record ends")
        elif node.phase == "closing":
            node.expire(inf)
        else:
            node.interrupt("its record ends", 0.0)
        return self._take()

    def _take(self) -> list[KeyedMessage]:
        self.node.take_actions()
        sent, self._sent.messages = self._sent.messages, []
        return sent


@contextmanager
def made_here(failing: str, errors: tuple[type[Exception], ...] = (ValueError,)) -> Iterator[None]:
    """Make a part of a recorded run again; ReplayError, which begins with `failing`, for one of `errors`."""
    try:
        yield
    except (RecordFileError, ReplayError):
        raise
    except errors as error:
        raise ReplayError(f"{failing}: {error}") from None


def agent_again(
    recorded: RecordedProcess, config: AgentConfig, instance: str, laws: list[Law], links: Links | None
) -> ReplayedProcess:
    with made_here(f"{config.name}: its law cannot be loaded here"):
        laws.append(make_law(config.control))
    # the deadline is that of a process, which has found its plant in this run
    config = replace(config, epoch=recorded.epoch, record="physics", deadline=0.0)
    with made_here(f"{config.name}: cannot be repeated here"):
        return ReplayedProcess(AgentNode(config, instance, links, laws[-1]), links)


def plant_again(recorded: RecordedProcess, info: RecordInfo, plant: PlantLike, links: Links | None) -> ReplayedProcess:
    """Make the process of the plant again, around a plant at t = 0; it waits for its recorder, as in the run."""
    config = with_recorder(info.plant, waits=info.driver == LIVE)
    return ReplayedProcess(PlantNode(replace(config, epoch=recorded.epoch, record="physics"), plant, links), links)


def recorded_links(info: RecordInfo, name: str) -> Links | None:
    config = info.agent(name)
    tree = info.plant.links if name == PLANT else {} if config is None else config.links
    with made_here(f"{name}: its emulated links cannot be loaded here"):
        return links_of(name, tree)


def start_plant_of(info: RecordInfo, make_plant: MakePlant) -> PlantLike:
    with made_here("the plant of the record cannot be started here", (ValueError, RuntimeError, OSError)):
        return make_plant(info.plant)
