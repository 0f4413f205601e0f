"""The plant in real time over the toy plant, on a fake clock; the test plays the agents."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.plant.plant_node import PlantNode
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Answer, Command, Leave, Message, PlantEvent, State, Telemetry
from gridpeers.wire.node import Fetch, Publish
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant

KEYS = Keys("toy")
T_C = 0.02


class Lab:
    """The toy plant on a fake clock, with all agents played by the test."""

    def __init__(self, n: int = 3, *, spares: tuple[str, ...] = (), **changes: Any) -> None:
        config, _ = toy_configs(n, end=2.0)
        config = replace(
            config,
            clock="wall",
            settings=replace(config.settings, spares=spares),
            agents=tuple(name for name in config.agents if name not in spares),
        )
        config = replace(config, **changes)
        self.now = 50.0
        self.toy = ToyPlant(config)
        self.side = PlantNode(config, self.toy)
        self.sent: list[tuple[str, Message]] = []
        self.fetched: list[str] = []
        self.side.start(self.now)
        self.do()

    def do(self) -> None:
        """Take the actions, and let it work."""
        while True:
            for action in self.side.take_actions():
                if isinstance(action, Publish):
                    self.sent.append((action.key, decode(action.payload)))
                elif isinstance(action, Fetch):
                    self.fetched.append(action.key)
            if not self.side.work(self.now):
                return

    def token(self, name: str, instance: str = "a", *, gone: bool = False) -> None:
        """A token of an agent comes or goes."""
        (self.side.vanished if gone else self.side.appeared)(KEYS.alive_agent(name, instance), self.now)
        self.do()

    def join(self, *names: str, instance: str = "a", life: int = 1) -> None:
        """Agents come, and answer for their nameplates."""
        for name in names:
            self.token(name, instance)
            plate = replace(Agent(agent_config(name)).nameplate, epoch=life)
            self.hear(KEYS.nameplate(name, instance), plate)

    def hear(self, key: str, message: Message) -> None:
        """A message comes in."""
        self.side.received(key, encode(message), self.now)
        self.do()

    def state(self, name: str, seq: int, P_set: float, life: int = 1, *, fault: str = "") -> None:
        """An agent's state comes in."""
        state = State(
            sender=name,
            epoch=life,
            seq=seq,
            t=0.0,
            P_set=P_set,
            V_set=277.0,
            Q=0.0,
            fault=fault,
            idle=bool(fault),
        )
        self.hear(KEYS.state(name), state)

    def leave(self, name: str, life: int = 1) -> None:
        """An agent says that it leaves."""
        self.hear(KEYS.leave(name), Leave(sender=name, epoch=life, seq=0, t=0.0))

    def ask(self, verb: Any, argument: str | dict[str, Any] = "", **further: Any) -> Answer:
        """Send a command with a name, or with a command to links."""
        content = {"argument": argument} if isinstance(argument, str) else {"link_command": argument}
        command = Command(sender="cli", epoch=1, seq=7, t=0.0, verb=verb, reply_to="z1", **content, **further)
        self.hear(KEYS.command, command)
        key, answer = next((key, m) for key, m in reversed(self.sent) if isinstance(m, Answer))
        assert (key, answer.seq) == (KEYS.answer("z1"), 7)
        return answer

    def step(self, count: int = 1, delay: float = 0.0) -> None:
        """Make steps, each so late (s)."""
        for _ in range(count):
            self.now = max(self.now, self.side.deadline + delay)  # in a rush after a late step, the next is due already
            self.side.expire(self.now)
            self.do()

    def take(self, kind: type[Message]) -> list[Any]:
        """Messages of a type since last taken."""
        taken = [message for _, message in self.sent if type(message) is kind]
        self.sent = [(key, message) for key, message in self.sent if type(message) is not kind]
        return taken

    def events(self, kind: str) -> list[PlantEvent]:
        """Events of a kind, once the run has been ended."""
        self.side.interrupt("enough", self.now)
        self.do()
        telemetry: list[Telemetry] = self.take(Telemetry)
        return [event for message in telemetry for event in message.events if event.kind == kind]


def running(n: int = 3, **changes: Any) -> Lab:
    """A plant that runs, with all its agents."""
    lab = Lab(n, **changes)
    lab.join(*lab.side.config.agents)
    assert lab.side.phase == "running"
    return lab
