"""A process of a recorded run, made again: the same node, called as it was, in no time of its own."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.agents.laws.law import Law
from gridpeers.agents.realtime_agent import RealtimeAgent
from gridpeers.lab.replay.recorded_process import RecordedProcess, RecordedStep, ReplayError
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant
from gridpeers.plant.realtime.realtime_plant import RealtimePlant
from gridpeers.scenarios.drivers.telemetry_client import with_recorder
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.wire.codec import KINDS, encode, sound
from gridpeers.wire.journal import (
    EACH_TICK,
    MessageReference,
    ProcessEvent,
    ReceivedMessage,
    RejectedCount,
    SentMessage,
    Token,
    WakeUp,
    kind_of,
)
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, Measurement, State
from gridpeers.wire.node import Loss

MakePlant = Callable[[PlantConfig], LivePlant]
"""Starts the plant of a configuration."""


class Message(NamedTuple):
    """A message that a node has sent; the key is without `gridpeers/<run>/`."""

    key: str
    payload: bytes


class _Outbox:
    """Takes what a node sends (`gridpeers.wire.traffic.Traffic`); of the rest the record has a note."""

    def __init__(self, cut: int) -> None:
        self._cut = cut
        self.messages: list[Message] = []

    def sent(self, key: str, payload: bytes) -> None:
        self.messages.append(Message(key[self._cut :], payload))

    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None:
        pass

    def lost(self, key: str, kind: str, count: int, at: float) -> None:
        pass

    def token(self, key: str, at: float, *, appeared: bool) -> None:
        pass

    def line(self, text: str) -> None:
        pass


class ReplayedProcess:
    """One process, made again: its node, which has not started, with the emulated links into it."""

    def __init__(self, recorded: RecordedProcess, node: RealtimeAgent | RealtimePlant, links: Links | None) -> None:
        self.recorded, self.node, self.links = recorded, node, links
        self._root = node.keys.prefix
        self._sent = _Outbox(len(self._root))
        node.traffic = self._sent

    @property
    def name(self) -> str:
        """Its agent, or "plant"."""
        return self.recorded.name

    def use_links(self, links: Links) -> None:
        """Put emulated links before a node that has none."""
        self.links = links
        self.node.use_links(links)

    def hears(self, key: str) -> bool:
        return self._root + key in self.node.routes and not self.node.finished

    def take(self, step: RecordedStep, message: Message | None = None) -> list[Message]:
        """Call the node as in a recorded step, with the message that it hears there, if any; return what it sent."""
        node, entry = self.node, step.entry
        if isinstance(entry, RejectedCount) and entry.kind in KINDS:  # the record has their number alone
            node.lost(Loss(self._root + entry.key, entry.kind, "as recorded", entry.count), entry.at or 0.0)
        elif isinstance(entry, MessageReference | ReceivedMessage):
            assert message is not None
            return self.hear(message, entry.at or 0.0)
        if isinstance(entry, Token):
            (node.appeared if entry.appeared else node.vanished)(self._root + entry.key, entry.at or 0.0)
        elif isinstance(entry, WakeUp):
            (node.work if entry.work else node.expire)(entry.at)
        elif isinstance(entry, ProcessEvent):
            self._control(entry)
        return self._take()

    def hear(self, message: Message, at: float) -> list[Message]:
        """Give the node a message that arrived at this time (s, monotonic); return what it sent."""
        self.node.received(self._root + message.key, message.payload, at)
        return self._take()

    def end(self) -> list[Message]:
        """Have a node whose journal ends before it does report the rest of its rows, or on its links; return that."""
        node = self.node
        if isinstance(node, RealtimeAgent):
            node.leave("its record ends")
        elif node.phase == "closing":
            node.expire(inf)
        else:
            node.interrupt("its record ends", 0.0)
        return self._take()

    def _control(self, entry: ProcessEvent) -> None:
        node = self.node
        if entry.kind != "leave":
            if entry.kind == "session" and isinstance(node, RealtimeAgent):
                node.session_broken = True  # also of an agent whose session was sound, but not that of its process
            node.start(entry.at or 0.0)
        elif isinstance(node, RealtimeAgent):
            node.asked_to_leave(entry.text)

    def _take(self) -> list[Message]:
        self.node.take_actions()
        sent, self._sent.messages = self._sent.messages, []
        return sent


def agent_again(
    recorded: RecordedProcess, config: AgentConfig, instance: str, laws: list[Law], links: Links | None
) -> ReplayedProcess:
    """Make the process of an agent again; its law is added to a list, to be closed."""
    try:
        law = make_law(config.control)
    except ValueError as error:
        raise ReplayError(f"{config.name}: its law cannot be made here: {error}") from None
    laws.append(law)
    # the deadline is that of a process, which has found its plant in this run
    config = replace(config, epoch=recorded.epoch, record="physics", deadline=0.0)
    try:
        node = RealtimeAgent(config, instance, links, law)
    except ValueError as error:
        raise ReplayError(f"{config.name}: cannot be made again here: {error}") from None
    return ReplayedProcess(recorded, node, links)


def plant_again(recorded: RecordedProcess, info: RecordInfo, plant: LivePlant, links: Links | None) -> ReplayedProcess:
    """Make the process of the plant again, around a plant at t = 0."""
    config = as_run(info, recorded.epoch)
    return ReplayedProcess(recorded, RealtimePlant(config, plant, links), links)


def as_run(info: RecordInfo, epoch: int) -> PlantConfig:
    """Return the configuration of the plant as its driver has completed it: it waits for its recorder too."""
    return replace(with_recorder(info.plant, waits=info.driver == LIVE), epoch=epoch, record="physics")


def recorded_links(info: RecordInfo, name: str) -> Links | None:
    """Return the emulated links into an agent or the plant, as they were at its start."""
    config = info.agent(name)
    tree = info.plant.links if name == PLANT else {} if config is None else config.links
    try:
        return links_of(name, tree)
    except ValueError as error:
        raise ReplayError(f"{name}: its emulated links cannot be made here: {error}") from None


def instance_of(step: RecordedStep) -> str:
    """Return the instance of a process from its first step, which is its start."""
    entry = step.entry
    return entry.text.rpartition(" ")[2] if isinstance(entry, ProcessEvent) and entry.kind == "start" else ""


def message_of(process: RecordedProcess, step: RecordedStep) -> Message | None:
    """Return the message that a process heard in a step; None if it heard none, or the record does not have it."""
    entry = step.entry
    if isinstance(entry, ReceivedMessage):
        return Message(entry.key, entry.payload)
    if isinstance(entry, MessageReference):
        found = process.message(entry, step.t)
        return None if found is None else Message(entry.key, encode(found))
    return None


def tick_message(message: Message | SentMessage) -> State | Measurement | None:
    """Return a state, or a measurement; None of anything else."""
    decoded = sound(message.payload) if kind_of(message.key) in EACH_TICK else None
    return decoded if isinstance(decoded, State | Measurement) else None


def start_plant_of(info: RecordInfo, make_plant: MakePlant) -> LivePlant:
    """Start the plant of a run."""
    try:
        return make_plant(info.plant)
    except (ValueError, RuntimeError, OSError) as error:
        raise ReplayError(f"the plant of the record cannot be started here: {error}") from None
