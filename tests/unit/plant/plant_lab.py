"""The node of the toy plant on a fake clock, with all agents played by the test."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_node import PlantNode
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Message, PlantEvent, State, Telemetry
from gridpeers.wire.node import Fetch, Publish
from tests.toy.toy_configs import agent_config
from tests.toy.toy_plant import ToyPlant

KEYS = Keys("toy")


class PlantLab:
    """The process of an agent has its name as instance, unless a test gives it another."""

    def __init__(self, config: PlantConfig, now: float = 0.0) -> None:
        self.now = now
        self.toy = ToyPlant(config)
        self.node = PlantNode(config, self.toy)
        self.sent: list[tuple[str, Message]] = []
        self.fetched: list[tuple[str, ...]] = []  # agents and instances that were asked for their nameplates
        self.node.start(now)
        self.do()

    def do(self) -> None:
        while True:
            for action in self.node.take_actions():
                if isinstance(action, Publish):
                    self.sent.append((action.key, decode(action.payload)))
                elif isinstance(action, Fetch):
                    self.fetched.append(KEYS.parts(action.key)[1:])
            if not self.node.work(self.now):
                return

    def token(self, name: str, instance: str = "", *, gone: bool = False) -> None:
        (self.node.vanished if gone else self.node.appeared)(KEYS.alive_agent(name, instance or name), self.now)
        self.do()

    def recorder(self, name: str, *, gone: bool = False) -> None:
        (self.node.vanished if gone else self.node.appeared)(KEYS.alive_recorder(name), self.now)
        self.do()

    def hear(self, key: str, message: Message) -> None:
        self.node.received(key, encode(message), self.now)
        self.do()

    def join(self, *names: str, instance: str = "", epoch: int = 1) -> None:
        """Agents come, and answer for their nameplates."""
        for name in names:
            self.token(name, instance)
            plate = replace(Agent(agent_config(name)).nameplate, epoch=epoch)
            self.hear(KEYS.nameplate(name, instance or name), plate)

    def state(self, name: str, seq: int, P_set: float = 5e4, epoch: int = 1, **fields: Any) -> None:
        t = round(0.02 * seq, 9)
        state = State(sender=name, epoch=epoch, seq=seq, t=t, P_set=P_set, V_set=277.0, Q=0.0, **fields)
        self.hear(KEYS.state(name), state)

    def take(self, kind: type[Message]) -> list[Any]:
        taken = [message for _, message in self.sent if type(message) is kind]
        self.sent = [(key, message) for key, message in self.sent if type(message) is not kind]
        return taken

    def events(self, kind: str) -> list[PlantEvent]:
        """Events of a kind, once the run has been ended."""
        self.node.interrupt("enough", self.now)
        self.do()
        telemetry: list[Telemetry] = self.take(Telemetry)
        return [event for message in telemetry for event in message.events if event.kind == kind]
