"""One free-running agent on a fake clock, with everything around it played by the test."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.laws.law import Law
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import AgentStatus, Message, State
from gridpeers.wire.node import Fetch, Listen, Log, Publish
from tests.toy.toy_configs import agent_config
from tests.toy.toy_messages import measurement, state

KEYS = Keys("toy")


class Lab:
    """inv1 on a fake clock, with everything around it played by the test."""

    def __init__(self, law: Law | None = None, **changes: Any) -> None:
        config = replace(agent_config("inv1"), clock="realtime", **changes)
        self.now = 100.0
        self.side = AgentNode(config, "me", law=law)
        self.listened: list[str] = []
        self.fetched: list[str] = []
        self.said: list[str] = []
        self.published: list[Message] = []
        self.keys: list[str] = []
        """Of what was published."""
        self.side.start(self.now)
        self.do()

    def do(self) -> None:
        for action in self.side.take_actions():
            if isinstance(action, Publish):
                self.published.append(decode(action.payload))
                self.keys.append(action.key)
            elif isinstance(action, Fetch):
                self.fetched.append(action.key)
            elif isinstance(action, Listen):
                self.listened.append(action.key)
            else:
                assert isinstance(action, Log)
                self.said.append(action.text)

    def token(self, name: str, instance: str = "a", *, gone: bool = False, epoch: int = 1) -> None:
        key = KEYS.alive_plant(epoch) if name == "plant" else KEYS.alive_agent(name, instance)
        (self.side.vanished if gone else self.side.appeared)(key, self.now)
        self.do()

    def plate(self, name: str, instance: str = "a", *, life: int = 1) -> None:
        key = KEYS.nameplate(name, instance)
        assert key in self.fetched
        self.hear(key, replace(Agent(agent_config(name)).nameplate, epoch=life))

    def hear(self, key: str, message: Message) -> None:
        self.side.received(key, encode(message), self.now)
        self.do()

    def meet(self, *names: str) -> None:
        for name in names:
            self.token(name)
            self.plate(name)

    def measure(self, k: int, **changes: Any) -> None:
        self.hear(KEYS.measurement("inv1"), measurement(k, **changes))

    def state(self, name: str, seq: int, t: float = 0.0, **changes: Any) -> None:
        self.hear(KEYS.state(name), state(name, seq, **{"t": t, "Q": 0.0, "island": "inv1"} | changes))

    def go(self, seconds: float) -> None:
        self.now += seconds + 1e-9  # sums of periods are not to fall short of their products
        self.side.expire(self.now)
        self.do()

    def age(self, name: str) -> float:
        return self.side.heard.age(name, self.now)

    def decided(self) -> list[State]:
        states = [message for message in self.published if isinstance(message, State)]
        self.published = [message for message in self.published if not isinstance(message, State)]
        return states

    def status(self) -> AgentStatus:
        return [message for message in self.published if isinstance(message, AgentStatus)][-1]


def running(*neighbours: str, **changes: Any) -> Lab:
    lab = Lab(**changes)
    lab.token("plant")
    lab.meet(*neighbours)
    lab.measure(0)
    lab.go(0.0)
    assert len(lab.decided()) == 1
    return lab
