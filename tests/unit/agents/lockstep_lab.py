"""One agent under simulated time, with everything around it played by the test."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import Control, GraphRule
from gridpeers.agents.agent_node import AgentNode
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.links import Links
from gridpeers.wire.messages import Message, Nameplate, Prepare, Ready, State
from gridpeers.wire.node import Fetch, Listen, Publish
from tests.toy.toy_configs import agent_config
from tests.toy.toy_messages import measurement, state

KEYS = Keys("toy")


def nameplate(name: str, epoch: int = 1) -> Nameplate:
    return Agent(replace(agent_config(name), epoch=epoch)).nameplate


class Lab:
    """inv1, whose process is "me"; the process of any other agent is its name, unless the test says otherwise."""

    def __init__(self, graph: GraphRule = "full", links: Links | None = None, **changes: Any) -> None:
        config = replace(agent_config("inv1", Control(secondary="all", graph=graph)), **changes)
        self.node = AgentNode(config, "me", links)
        self.done: list[tuple[str, str]] = []
        """("listen", name), ("ask", process) and ("ready", number), in the order of the actions."""
        self.decided: list[State] = []
        self.node.start(0.0)
        self.node.appeared(KEYS.alive_plant(1), 0.0)
        self.do()

    def do(self) -> None:
        for action in self.node.take_actions():
            if isinstance(action, Listen):
                self.done.append(("listen", KEYS.parts(action.key)[1]))
            elif isinstance(action, Fetch):
                self.done.append(("ask", KEYS.parts(action.key)[2]))
            elif isinstance(action, Publish):
                message = decode(action.payload)
                if isinstance(message, Ready):
                    self.done.append(("ready", str(message.seq)))
                elif isinstance(message, State):
                    self.decided.append(message)

    def hear(self, key: str, message: Message, now: float = 0.0) -> None:
        self.node.received(key, encode(message), now)
        self.do()

    def token(self, name: str, instance: str = "", *, gone: bool = False) -> None:
        key = KEYS.alive_agent(name, instance or name)
        (self.node.vanished if gone else self.node.appeared)(key, 0.0)
        self.do()

    def answer(self, name: str, instance: str = "", *, epoch: int = 1, **changes: Any) -> None:
        self.hear(KEYS.nameplate(name, instance or name), replace(nameplate(name, epoch), **changes))

    def meet(self, *names: str) -> None:
        for name in names:
            self.token(name)
            self.answer(name)
            self.answer(name)

    def prepare(self, number: int, *names: str, **instances: str) -> None:
        processes = {"inv1": "me"} | {name: name for name in names} | instances
        roster, ids = tuple(processes), tuple(processes.values())
        self.hear(KEYS.control, Prepare(sender="plant", epoch=1, seq=number, t=0.0, roster=roster, instances=ids))

    def measure(self, k: int, t: float | None = None) -> None:
        changes = {} if t is None else {"t": t}
        self.hear(KEYS.measurement("inv1"), measurement(k, f=59.9, **changes))

    def state(self, name: str, k: int, P_set: float = 5e4) -> None:
        self.hear(KEYS.state(name), state(name, k, P_set=P_set, Q=0.0))

    def take(self) -> list[tuple[str, str]]:
        done, self.done = self.done, []
        return done

    @property
    def missing(self) -> list[tuple[str, str]]:
        return [(what, who) for what, who in self.node.policy.missing()]


def ticking(*names: str, tick: int = 0) -> Lab:
    lab = Lab()
    lab.meet(*names)
    lab.prepare(0, *names)
    lab.measure(tick - 1 if tick else 0)
    lab.decided.clear()
    lab.take()
    return lab
