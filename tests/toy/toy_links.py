"""A network for the cores in which every link keeps its order and nothing else is sure: who is faster is drawn.

That is what Zenoh promises, so what holds here for every drawing must hold there.
"""

from __future__ import annotations

import random
from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from functools import partial

import msgspec

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_node import AgentNode
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_node import PlantNode
from gridpeers.wire.codec import decode
from gridpeers.wire.messages import PlantEvent, Telemetry
from gridpeers.wire.node import Fetch, Listen, Publish
from tests.toy.toy_plant import ToyPlant

EndSet = PlantNode | AgentNode


class Links:
    """Plant and agents, joined by links. Everybody is known by its token."""

    def __init__(self, plant_config: PlantConfig, agent_configs: Iterable[AgentConfig], rng: random.Random) -> None:
        self.plant = PlantNode(plant_config, ToyPlant(plant_config))
        self._configs = {config.name: config for config in agent_configs}
        self._born = 0
        self.agents = [
            self._bear(config) for config in agent_configs if config.name not in plant_config.settings.spares
        ]
        self.telemetry: list[Telemetry] = []
        self._rng = rng
        self._living: dict[str, EndSet] = {side.token: side for side in (self.plant, *self.agents)}
        self._links: defaultdict[tuple[str, str], deque[Callable[[], None]]] = defaultdict(deque)
        self._subscribed: set[tuple[str, str, str]] = set()
        """Sender, receiver and key of the subscriptions that have arrived at the sender."""
        self._keys = {token: set(side.subscriptions) for token, side in self._living.items()}
        """All that somebody has subscribed to."""
        for side in self._living.values():
            side.start(0.0)
            for other in self._living.values():
                if other is not side:
                    self._subscribed |= {(other.token, side.token, key) for key in side.subscriptions}
                    self._send(side.token, other.token, partial(other.appeared, side.token, 0.0))

    @property
    def rows(self) -> list[tuple[float, ...]]:
        return [row for message in self.telemetry for row in message.rows]

    @property
    def events(self) -> list[PlantEvent]:
        return [event for message in self.telemetry for event in message.events]

    def agent(self, name: str) -> AgentNode:
        return next(agent for agent in self.agents if self.plant.keys.parts(agent.token)[2] == name)

    def kill(self, name: str) -> None:
        """Kill an agent: what it has sent arrives, then its token vanishes, everywhere at another time."""
        self._leave(self.agent(name))

    def run(self, until_tick: int | None = None) -> None:
        while not self.plant.finished and (until_tick is None or self.plant.stepper.tick < until_tick):
            assert self.step(), (
                f"stalled in phase {self.plant.phase} at tick {self.plant.stepper.tick}, "
                f"without {self.plant.missing_messages()}"
            )

    def step(self) -> bool:
        """Deliver one thing, or let the plant work; False if nothing is left to do."""
        for agent in [agent for agent in self.agents if agent.finished]:
            self._leave(agent)
        waiting = [link for link, deliveries in self._links.items() if deliveries and link[1] in self._living]
        if waiting and self._rng.random() < 0.95:
            self._links[self._rng.choice(waiting)].popleft()()
        elif not self.plant.work(0.0) and not waiting:
            return False
        for token, side in list(self._living.items()):
            for action in side.take_actions():
                if isinstance(action, Publish):
                    self._publish(token, action.key, action.payload)
                elif isinstance(action, Fetch):
                    self._to_all(token, lambda to, a=action, b=token: partial(self._answer, to, b, a.key))
                elif isinstance(action, Listen):
                    self._keys[token].add(action.key)
                    self._to_all(token, lambda to, a=action, b=token: partial(self._subscribed.add, (to, b, a.key)))
        return True

    def _bear(self, config: AgentConfig) -> AgentNode:
        self._born += 1
        return AgentNode(config, f"p{self._born}")

    def start(self, name: str) -> None:
        """Start an agent, perhaps once more: all others hear of it, and it of them, each at another time."""
        config = self._configs[name]
        self._configs[name] = msgspec.structs.replace(config, epoch=config.epoch + 1)
        agent = self._bear(self._configs[name])
        others = list(self._living)
        self.agents.append(agent)
        self._living[agent.token] = agent
        self._keys[agent.token] = set(agent.subscriptions)
        agent.start(0.0)
        for other in others:
            for a, b in ((agent.token, other), (other, agent.token)):
                for key in sorted(self._keys[a]):
                    self._send(a, b, partial(self._subscribed.add, (b, a, key)))
                self._send(a, b, partial(self._living[b].appeared, a, 0.0))

    def _leave(self, agent: AgentNode) -> None:
        del self._living[agent.token]
        self.agents.remove(agent)
        self._to_all(agent.token, lambda to: partial(self._living[to].vanished, agent.token, 0.0))

    def _to_all(self, sender: str, delivery: Callable[[str], Callable[[], None]]) -> None:
        for to in self._living:
            if to != sender:
                self._send(sender, to, delivery(to))

    def _send(self, sender: str, to: str, delivery: Callable[[], None]) -> None:
        self._links[sender, to].append(delivery)

    def _answer(self, token: str, asker: str, key: str) -> None:
        side = self._living[token]
        if isinstance(side, AgentNode) and side.nameplate[0] == key and asker in self._living:
            self._send(token, asker, partial(self._living[asker].received, *side.nameplate, 0.0))

    def _publish(self, sender: str, key: str, payload: bytes) -> None:
        if key == self.plant.keys.telemetry:
            telemetry = decode(payload)
            assert isinstance(telemetry, Telemetry)
            self.telemetry.append(telemetry)
            for name in telemetry.awaited:
                self.start(name)
        for to, side in self._living.items():
            if (sender, to, key) in self._subscribed:
                self._send(sender, to, partial(side.received, key, payload, 0.0))
