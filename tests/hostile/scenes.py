"""Cores in the middle of a run of three: each is told what is truly sent, and whatever else a test makes up."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_node import AgentNode
from gridpeers.plant.plant_node import PlantNode
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import AgentStatus, Measurement, Message, Nameplate, Prepare, Ready, State
from gridpeers.wire.node import Fetch, Listen, Log, Publish
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant

KEYS = Keys("toy")
T_C = 0.02
EPOCH = 7  # That in which everybody really lives

NAMES = ("inv1", "inv2", "inv3")
INSTANCES = {"inv1": "a", "inv2": "b", "inv3": "c"}


def plate(name: str) -> Nameplate:
    return Agent(replace(agent_config(name), epoch=EPOCH)).nameplate


def state(name: str, k: int) -> State:
    share = 60e3 + 5e3 * NAMES.index(name)
    return State(sender=name, epoch=EPOCH, seq=k, t=round(k * T_C, 9), P_set=share, V_set=277.0, Q=1e3, island="inv1")


def measurement(k: int) -> Measurement:
    return Measurement(
        sender="plant", epoch=EPOCH, seq=k, t=round(k * T_C, 9), to="inv1", P=5e4, Q=0.0, V=277.0, f=59.95,
        P_set=5e4, V_set=277.0, grid_connected=False, island="inv1", roster=NAMES,
    )  # fmt: skip


class Scene:
    """A core in the middle of a run: what it is told, and what it does."""

    def __init__(self, side: AgentNode | PlantNode, *, realtime: bool) -> None:
        self.side: Any = side
        self._realtime = realtime
        self.now = 100.0
        self.done: list[object] = []
        self.side.start(self.now)

    def honest(self, k: int) -> None:
        """Bring all that is truly sent at tick k, and let it work."""
        agent = isinstance(self.side, AgentNode)
        if agent:
            self.hear(KEYS.measurement("inv1"), measurement(k))
        for name in NAMES[1:] if agent else NAMES:
            self.hear(KEYS.state(name), state(name, k))
        if self._realtime:
            self.now = self.now + T_C + 1e-9 if agent else self.side.deadline
            self.side.expire(self.now)
        self.take()

    def hear(self, key: str, *messages: Message) -> None:
        for message in messages:
            self.side.received(key, encode(message), self.now)

    def take(self) -> None:
        """Note what it does, and let it work until it waits again."""
        while True:
            self.done += map(_comparable, self.side.take_actions())
            if not self.side.work(self.now):
                return


def _comparable(action: Publish | Fetch | Listen | Log) -> object:
    """An action, but for what a core counts of messages that it did not use."""
    if isinstance(action, Publish):
        message = decode(action.payload)
        return action.key, replace(message, rejected=0) if isinstance(message, AgentStatus) else message
    return action


class RealtimeAgentScene(Scene):
    """inv1 in real time."""

    def __init__(self) -> None:
        super().__init__(AgentNode(replace(agent_config("inv1"), clock="realtime", epoch=EPOCH), "a"), realtime=True)
        meet(self, *NAMES[1:])


class AgentScene(Scene):
    """inv1 in simulated time."""

    def __init__(self) -> None:
        super().__init__(AgentNode(replace(agent_config("inv1"), epoch=EPOCH), "a"), realtime=False)
        meet(self, *NAMES[1:])
        instances = tuple(INSTANCES[name] for name in NAMES)
        prepare = Prepare(sender="plant", epoch=EPOCH, seq=0, t=0.0, roster=NAMES, instances=instances)
        self.hear(KEYS.control, prepare)
        for name in NAMES[1:]:
            self.hear(KEYS.nameplate(name, INSTANCES[name]), plate(name))


class RealtimePlantScene(Scene):
    """The toy plant in real time."""

    def __init__(self) -> None:
        config, _ = toy_configs(3, end=None)  # type: ignore[arg-type]
        config = replace(config, clock="realtime", epoch=EPOCH)
        super().__init__(PlantNode(config, ToyPlant(config)), realtime=True)
        meet(self, *NAMES)


class PlantScene(Scene):
    """The toy plant in simulated time."""

    def __init__(self) -> None:
        config, _ = toy_configs(3, end=1e4)
        config = replace(config, epoch=EPOCH)
        super().__init__(PlantNode(config, ToyPlant(config)), realtime=False)
        meet(self, *NAMES)
        for name in NAMES:
            self.hear(KEYS.ready(name), Ready(sender=name, epoch=EPOCH, seq=0, t=0.0))
        self.take()


def meet(scene: Scene, *names: str) -> None:
    """Bring the plant's token, and token and nameplate of agents."""
    scene.side.appeared(KEYS.alive_plant(EPOCH), scene.now)
    for name in names:
        scene.side.appeared(KEYS.alive_agent(name, INSTANCES[name]), scene.now)
        scene.hear(KEYS.nameplate(name, INSTANCES[name]), plate(name))
    if isinstance(scene.side, PlantNode):
        scene.take()
