"""Every message with every value, from anybody, to both sides under both kinds of time: nothing is believed.

A core that is flooded with them must do, to the byte, what one does that is not.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from msgspec.structs import replace

from agents.agent import Agent
from agents.lockstep_agent import LockstepAgent
from agents.realtime.realtime_agent import RealtimeAgent
from plant.lockstep_plant import LockstepPlant
from plant.realtime.realtime_plant import RealtimePlant
from tests.hostile.cases import hostile
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant
from wire.actions import Fetch, Listen, Log, Publish
from wire.codec import KINDS, decode, encode
from wire.keys import Keys
from wire.messages import AgentStatus, Measurement, Message, Nameplate, Prepare, Ready, State
from wire.node import Node

KEYS = Keys("toy")
T_C = 0.02
EPOCH = 7
"""That in which everybody really lives."""

NAMES = ("inv1", "inv2", "inv3")
INSTANCES = {"inv1": "a", "inv2": "b", "inv3": "c"}

TOKENS = tuple(
    f"gridpeers/toy/alive/{tail}"
    for tail in (
        "plant/0", "plant/8", "plant/x", "plant/99999999999999999999", "plant", "plant/8/9", "agent/inv2/x",
        "agent/inv9/x", "agent/\x1b[2J/x", "agent/inv2", "agent/inv1/\n", "recorder/x", "", "agent//", "x",
    )
)  # fmt: skip


def plate(name: str) -> Nameplate:
    """Valid nameplate of an agent."""
    return Agent(replace(agent_config(name), epoch=EPOCH)).nameplate


def state(name: str, k: int) -> State:
    """Valid state of a neighbour at tick k."""
    share = 60e3 + 5e3 * NAMES.index(name)
    return State(sender=name, epoch=EPOCH, seq=k, t=round(k * T_C, 9), P_set=share, V_set=277.0, Q=1e3, island="inv1")


def measurement(k: int) -> Measurement:
    """Valid measurement of inv1 at tick k."""
    return Measurement(
        sender="plant", epoch=EPOCH, seq=k, t=round(k * T_C, 9), to="inv1", P=5e4, Q=0.0, V=277.0, f=59.95,
        P_set=5e4, V_set=277.0, grid_connected=False, island="inv1", roster=NAMES,
    )  # fmt: skip


class _Played:
    """A core in the middle of a run: what it is told, and what it does."""

    def __init__(self, side: RealtimeAgent | RealtimePlant | LockstepAgent | LockstepPlant) -> None:
        self.side: Any = side
        self.now = 100.0
        self.done: list[object] = []
        self.side.start(self.now)

    def honest(self, k: int) -> None:
        """Bring all that is truly sent at tick k, and let it work."""
        raise NotImplementedError

    def hear(self, key: str, *messages: Message) -> None:
        for message in messages:
            self.side.received(key, encode(message), self.now)

    def take(self) -> None:
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


class RealtimeAgentScene(_Played):
    """inv1 in wall-clock time."""

    def __init__(self) -> None:
        super().__init__(RealtimeAgent(replace(agent_config("inv1"), clock="wall", epoch=EPOCH), "a"))
        self.side.appeared(KEYS.alive_plant(EPOCH), self.now)
        for name in NAMES[1:]:
            self.side.appeared(KEYS.alive_agent(name, INSTANCES[name]), self.now)
            self.hear(KEYS.nameplate(name, INSTANCES[name]), plate(name))

    def honest(self, k: int) -> None:
        """Bring what is sent to it at tick k."""
        self.hear(KEYS.measurement("inv1"), measurement(k))
        for name in NAMES[1:]:
            self.hear(KEYS.state(name), state(name, k))
        self.now += T_C + 1e-9
        self.side.expire(self.now)
        self.take()


class AgentScene(_Played):
    """inv1 in simulated time."""

    def __init__(self) -> None:
        super().__init__(LockstepAgent(replace(agent_config("inv1"), epoch=EPOCH), "a"))
        self.side.appeared(KEYS.alive_plant(EPOCH), self.now)
        for name in NAMES[1:]:
            self.side.appeared(KEYS.alive_agent(name, INSTANCES[name]), self.now)
            self.hear(KEYS.nameplate(name, INSTANCES[name]), plate(name), plate(name))
        instances = tuple(INSTANCES[name] for name in NAMES)
        prepare = Prepare(sender="plant", epoch=EPOCH, seq=0, t=0.0, roster=NAMES, instances=instances)
        self.hear(KEYS.control, prepare)

    def honest(self, k: int) -> None:
        """Bring what is sent to it at tick k."""
        self.hear(KEYS.measurement("inv1"), measurement(k))
        for name in NAMES[1:]:
            self.hear(KEYS.state(name), state(name, k))
        self.take()


class RealtimePlantScene(_Played):
    """The toy plant in wall-clock time."""

    def __init__(self) -> None:
        config, _ = toy_configs(3, end=None)  # type: ignore[arg-type]
        config = replace(config, clock="wall", epoch=EPOCH)
        super().__init__(RealtimePlant(config, ToyPlant(config)))
        _join(self)

    def honest(self, k: int) -> None:
        """Bring what is sent to it at tick k."""
        for name in NAMES:
            self.hear(KEYS.state(name), state(name, k))
        self.now = self.side.deadline
        self.side.expire(self.now)
        self.take()


class PlantScene(_Played):
    """The toy plant in simulated time."""

    def __init__(self) -> None:
        config, _ = toy_configs(3, end=1e4)
        config = replace(config, epoch=EPOCH)
        super().__init__(LockstepPlant(config, ToyPlant(config)))
        _join(self)
        for name in NAMES:
            self.hear(KEYS.ready(name), Ready(sender=name, epoch=EPOCH, seq=0, t=0.0))
        self.take()

    def honest(self, k: int) -> None:
        """Bring what is sent to it at tick k."""
        for name in NAMES:
            self.hear(KEYS.state(name), state(name, k))
        self.take()


def _join(scene: _Played) -> None:
    for name in NAMES:
        scene.side.appeared(KEYS.alive_agent(name, INSTANCES[name]), scene.now)
        scene.hear(KEYS.nameplate(name, INSTANCES[name]), plate(name))
    scene.take()


def flood(side: Node, rng: random.Random) -> list[tuple[str, bytes]]:
    """All that is hostile to a core, in some order."""
    truth = {key: (route.sender, route.types) for key, route in side.routes.items()}
    truth |= {KEYS.state("inv9"): ("inv9", ()), KEYS.telemetry: ("plant", ())}
    return list(hostile(truth, dict.fromkeys(("plant", *NAMES), EPOCH), rng))


@pytest.mark.parametrize("make", [RealtimeAgentScene, AgentScene, RealtimePlantScene, PlantScene])
def test_nothing_raises_and_nothing_false_is_believed(make: Callable[[], _Played]) -> None:
    """Set-points, rosters, neighbours' values, sessions, what is published: all as if nobody had said anything."""
    rng = random.Random(1)
    flooded, calm = make(), make()
    sent = 0
    for k, chunk in enumerate(_chunks(flood(flooded.side, rng), 500)):
        for key, payload in chunk:
            flooded.side.received(key, payload, flooded.now)
            sent += 1
        for scene in (flooded, calm):
            scene.honest(k)
    counts = flooded.side.rejects.counts
    lines = flooded.side.rejects.take_lines()

    assert sent > 50_000
    assert not flooded.side.finished
    assert len(calm.done) > 100
    assert flooded.done == calm.done
    assert "failed" not in counts, lines
    assert sent <= sum(counts.values())
    assert not calm.side.rejects.counts
    assert len(lines) <= len(KINDS)
    assert all(line.isprintable() and len(line) < 600 for line in lines)


@pytest.mark.parametrize("make", [RealtimeAgentScene, AgentScene, RealtimePlantScene, PlantScene])
def test_tokens_of_anybody_change_nothing(make: Callable[[], _Played]) -> None:
    """Whoever can connect can hold tokens: garbled, of other plants, of a namesake; what is decided stays the same."""
    flooded, calm = make(), make()
    for k in range(60):
        for token in TOKENS if k % 2 else ():
            flooded.side.appeared(token, flooded.now)
        for scene in (flooded, calm):
            scene.honest(k)
        for token in TOKENS if k % 3 else ():
            flooded.side.vanished(token, flooded.now)
    said = [action.text for action in flooded.done if isinstance(action, Log)]

    assert not flooded.side.finished
    assert _decided(flooded) == _decided(calm)
    assert all(text.isprintable() for text in said)


@pytest.mark.parametrize("make", [RealtimeAgentScene, RealtimePlantScene])
def test_a_flood_of_tokens_does_not_flood_the_log(make: Callable[[], _Played]) -> None:
    """Ten thousand processes that claim a name, or names that nobody knows."""
    scene = make()
    scene.honest(0)
    for i in range(5000):
        scene.side.appeared(KEYS.alive_agent("inv2", f"x{i}"), scene.now)
        scene.side.appeared(KEYS.alive_agent(f"who{i}", "x"), scene.now)
    scene.honest(1)

    assert len([action for action in scene.done if isinstance(action, Log)]) < 50


def _decided(scene: _Played) -> list[object]:
    """The states, measurements and rows that a core has published."""
    kinds = ("state", "measurement", "telemetry")
    done = [entry for entry in scene.done if isinstance(entry, tuple) and not isinstance(entry, Fetch | Listen | Log)]
    return [entry for entry in done if entry[0].split("/")[2] in kinds]


def _chunks(items: list[Any], size: int) -> Iterator[list[Any]]:
    for i in range(0, len(items), size):
        yield items[i : i + size]
