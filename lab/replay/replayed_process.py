"""A process of a recorded run, made again: the same node, called as it was, in no time of its own."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.agents.laws.law import Law
from gridpeers.agents.realtime_agent import RealtimeAgent
from gridpeers.lab.replay.recorded_process import Message, RecordedProcess, RecordedStep, ReplayError
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant
from gridpeers.plant.realtime.realtime_plant import RealtimePlant
from gridpeers.scenarios.drivers.telemetry_client import with_recorder
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.wire.codec import KINDS
from gridpeers.wire.journal import ProcessEvent, RejectedCount, Token, WakeUp
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT
from gridpeers.wire.node import Loss
from gridpeers.wire.traffic import Traffic

MakePlant = Callable[[PlantConfig], LivePlant]


class _Outbox(Traffic):
    """Takes the messages of a node; the record has all else."""

    def __init__(self, cut: int) -> None:
        self._cut = cut
        self.messages: list[Message] = []

    def sent(self, key: str, payload: bytes) -> None:
        self.messages.append(Message(key[self._cut :], payload))


class ReplayedProcess:
    def __init__(self, node: RealtimeAgent | RealtimePlant, links: Links | None) -> None:
        self.node, self.links = node, links
        self._root = node.keys.prefix
        self._sent = _Outbox(len(self._root))  # type: ignore[abstract]  # methods of the protocol do nothing
        node.traffic = self._sent

    def use_links(self, links: Links) -> None:
        self.links = links
        self.node.use_links(links)

    def hears(self, key: str) -> bool:
        return self._root + key in self.node.routes and not self.node.finished

    def take(self, step: RecordedStep, message: Message | None = None) -> list[Message]:
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
            if entry.kind == "session" and isinstance(node, RealtimeAgent):
                node.session_broken = True  # also of an agent whose session was sound, but not that of its process
            node.start(at)
        elif isinstance(node, RealtimeAgent):
            node.asked_to_leave(entry.text)
        return self._take()

    def hear(self, message: Message, at: float) -> list[Message]:
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

    def _take(self) -> list[Message]:
        self.node.take_actions()
        sent, self._sent.messages = self._sent.messages, []
        return sent


def agent_again(
    recorded: RecordedProcess, config: AgentConfig, instance: str, laws: list[Law], links: Links | None
) -> ReplayedProcess:
    laws.append(law_again(config))
    try:
        return ReplayedProcess(RealtimeAgent(agent_as_run(config, recorded.epoch), instance, links, laws[-1]), links)
    except ValueError as error:
        raise ReplayError(f"{config.name}: cannot be made again here: {error}") from None


def law_again(config: AgentConfig) -> Law:
    try:
        return make_law(config.control)
    except ValueError as error:
        raise ReplayError(f"{config.name}: its law cannot be made here: {error}") from None


def agent_as_run(config: AgentConfig, epoch: int) -> AgentConfig:
    """Return a configuration for a replay; its deadline is that of a process, which has found its plant in this run."""
    return replace(config, epoch=epoch, record="physics", deadline=0.0)


def plant_again(recorded: RecordedProcess, info: RecordInfo, plant: LivePlant, links: Links | None) -> ReplayedProcess:
    """Make the process of the plant again, around a plant at t = 0; it waits for its recorder, as in the run."""
    config = with_recorder(info.plant, waits=info.driver == LIVE)
    return ReplayedProcess(RealtimePlant(replace(config, epoch=recorded.epoch, record="physics"), plant, links), links)


def recorded_links(info: RecordInfo, name: str) -> Links | None:
    config = info.agent(name)
    tree = info.plant.links if name == PLANT else {} if config is None else config.links
    try:
        return links_of(name, tree)
    except ValueError as error:
        raise ReplayError(f"{name}: its emulated links cannot be made here: {error}") from None


def start_plant_of(info: RecordInfo, make_plant: MakePlant) -> LivePlant:
    try:
        return make_plant(info.plant)
    except (ValueError, RuntimeError, OSError) as error:
        raise ReplayError(f"the plant of the record cannot be started here: {error}") from None
