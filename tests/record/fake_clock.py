"""A recorded run in real time whose clock is fake: one thread, no session, the same bytes every time.

The nodes are those of real processes, and are called as `gridpeers.wire.driver.drive` calls them. So what depends on
lost and late messages, frozen agents and commands of people can be tested without a race.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from heapq import heappop, heappush
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig, Control
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.carriers.law_registry import make_law
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_node import PlantNode
from gridpeers.scenarios.drivers.telemetry_client import RECORDER
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.record import Recorder
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.journal import RecordLevel
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import PLANT, Command, Journal, LinkReport, LinkRequest, Telemetry
from gridpeers.wire.node import Fetch, Listen, Log, Loss, Publish
from tests.record.recorded_runs import toy_info
from tests.toy.toy_configs import ALL_FULL, toy_configs
from tests.toy.toy_plant import ToyPlant

Node = PlantNode | AgentNode

Delay = Callable[[str, str, str, int], float | None]
"""Returns how long (s) a message is on the wire, by sender, receiver, key and number on that link; None: it is lost."""

START = 1000.0  # Time (s) on the fake clock at which the processes start
READY = 0.26  # Time (s) after which the run is at t = 0, about: all have met, and the plant has waited its lead


def at_once(src: str, dst: str, key: str, number: int) -> float:
    return 0.001


class FakeClockRun:
    """A run of the toy plant, whose recorder takes what it publishes for recorders; each message has its delay."""

    def __init__(
        self, plant: PlantConfig, agents: tuple[AgentConfig, ...], recorder: Recorder, delay: Delay = at_once
    ) -> None:
        self.keys = Keys(plant.run)
        self.now = START
        self._delay, self._recorder = delay, recorder
        self._configs = {config.name: config for config in agents}
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = count()
        self._numbers: dict[tuple[str, str, str], int] = {}
        self._nodes: dict[str, Node] = {}
        self._subscribed: dict[str, set[str]] = {}
        self._frozen: dict[str, float] = {}
        """Until when (s) each frozen process does nothing."""
        self._lives: dict[str, int] = {}
        self._wakes: dict[str, float] = {}
        """When (s) each process is woken next."""
        config = replace(plant, epoch=int(START), recorders=(RECORDER,))
        self.plant = PlantNode(config, ToyPlant(config), links_of(PLANT, plant.links))
        self._join(self.plant, self.plant.subscriptions)
        self._tell(self.keys.alive_recorder(RECORDER), PLANT, appeared=True)
        for name in plant.agents:
            self.start(name)

    def at(self, t: float, do: Callable[[], None]) -> None:
        """Do something at a run time (s), at speed 1."""
        self._on(START + READY + t, do)

    def start(self, name: str) -> None:
        self._lives[name] = self._lives.get(name, 0) + 1
        config = replace(self._configs[name], epoch=int(self.now * 1000.0))
        links, law = links_of(name, config.links), make_law(config.control)
        agent = AgentNode(config, f"{name}x{self._lives[name]}", links, law)
        self._join(agent, agent.subscriptions)

    def stop(self, name: str) -> None:
        """Have an agent leave, as by Ctrl-C in its terminal."""
        agent = self._nodes[name]
        assert isinstance(agent, AgentNode)
        agent.leave("asked to leave: SIGINT")
        self._work(name)

    def kill(self, name: str) -> None:
        """End the process of an agent without a word."""
        self._gone(name)

    def freeze(self, name: str, seconds: float) -> None:
        self._frozen[name] = self.now + seconds

    def lose(self, name: str, key: str, number: int, kind: str = "excess") -> None:
        """Have a process drop messages on a key (without `gridpeers/<run>/`) unread, as in a flood."""
        self._nodes[name].lost(Loss(self.keys.prefix + key, kind, "4000 messages were waiting", number), self.now)
        self._work(name)

    def lose_sight(self, name: str, of: str, seconds: float) -> None:
        """Have a process not see the token of another one for some time (s)."""
        token = self._nodes[of].token
        self._tell(token, name, appeared=False)
        self._later(seconds, lambda: self._tell(token, name, appeared=True))

    def command(self, verb: Any, **further: Any) -> None:
        command = Command(sender="cli", epoch=1, seq=7, t=0.0, verb=verb, reply_to="z1", **further)
        self._send("cli", self.keys.command, encode(command))

    def run(self) -> None:
        while not self.plant.finished:
            due, _, do = heappop(self._events)
            self.now = max(self.now, due)
            do()

    def _on(self, time: float, do: Callable[[], None]) -> None:
        heappush(self._events, (time, next(self._order), do))

    def _later(self, seconds: float, do: Callable[[], None]) -> None:
        self._on(self.now + seconds, do)

    def _join(self, node: Node, subscriptions: tuple[str, ...]) -> None:
        """Start a process; then it and the others learn of each other."""
        name, others = node.name, list(self._nodes)
        self._nodes[name] = node
        for key in subscriptions:
            self._subscribed.setdefault(key, set()).add(name)
        node.start(self.now)
        self._work(name)
        for other in others:
            self._tell(self._nodes[other].token, name, appeared=True)
            self._tell(node.token, other, appeared=True)

    def _gone(self, name: str) -> None:
        node = self._nodes.pop(name)
        for receivers in self._subscribed.values():
            receivers.discard(name)
        for other in self._nodes:
            self._tell(node.token, other, appeared=False)

    def _tell(self, token: str, to: str, *, appeared: bool) -> None:
        def tell() -> None:
            if (node := self._nodes.get(to)) is not None:
                (node.appeared if appeared else node.vanished)(token, self.now)
                self._work(to)

        self._later(0.002, tell)

    def _wake(self, name: str, node: Node) -> None:
        """Wake a process, unless another one has its name by now; the frozen one does nothing until it thaws."""
        if self._nodes.get(name) is not node:
            return
        if (until := self._frozen.get(name, 0.0)) > self.now:
            self._on(until, lambda: self._wake(name, node))
            return
        if node.deadline <= self.now:
            node.expire(self.now)
            self._work(name)

    def _work(self, name: str) -> None:
        """Do what a node asks for, and wake it when it says."""
        node = self._nodes[name]
        while True:
            for action in node.take_actions():
                if isinstance(action, Publish):
                    self._publish(name, action)
                elif isinstance(action, Fetch):
                    self._fetch(name, action.key)
                elif isinstance(action, Listen):
                    self._subscribed.setdefault(action.key, set()).add(name)
                else:
                    assert isinstance(action, Log)
            if node.finished or not node.work(self.now):
                break
        if node.finished and name != PLANT:
            self._gone(name)
        elif not node.finished and self._wakes.get(name) != node.deadline:
            self._wakes[name] = node.deadline
            self._on(node.deadline, lambda: self._wake(name, node))

    def _publish(self, src: str, action: Publish) -> None:
        if action.key == self.keys.telemetry and src == PLANT:
            self._record(action.payload)
        self._send(src, action.key, action.payload)

    def _record(self, payload: bytes) -> None:
        message = decode(payload)
        assert isinstance(message, Telemetry | LinkReport | Journal | LinkRequest)
        self._recorder(message)
        if isinstance(message, Telemetry) and message.final:
            self._tell(self.keys.alive_recorder(RECORDER), PLANT, appeared=False)

    def _send(self, src: str, key: str, payload: bytes) -> None:
        for dst in sorted(self._subscribed.get(key, ())):
            link = src, dst, key.removeprefix(self.keys.prefix)
            number = self._numbers[link] = self._numbers.get(link, -1) + 1
            if (seconds := self._delay(*link, number)) is not None:
                self._later(seconds, partial(self._receive, dst, key, payload))

    def _receive(self, name: str, key: str, payload: bytes) -> None:
        """Hand a message over; a frozen process takes it when it thaws."""
        if (node := self._nodes.get(name)) is None:
            return
        if (until := self._frozen.get(name, 0.0)) > self.now:
            self._on(until, lambda: self._receive(name, key, payload))
            return
        node.received(key, payload, self.now)
        self._work(name)

    def _fetch(self, name: str, key: str) -> None:
        for node in self._nodes.values():
            if isinstance(node, AgentNode) and node.nameplate[0] == key:
                self._later(0.002, partial(self._receive, name, key, node.nameplate[1]))


def fake_clock_record(
    folder: Path,
    *,
    n: int = 3,
    spares: tuple[str, ...] = (),
    end: float = 1.0,
    netem: Netem | None = None,
    control: Control = ALL_FULL,
    record: RecordLevel = "all",
    delay: Delay = at_once,
    happens: Callable[[FakeClockRun], None] = lambda run: None,
) -> RunRecord:
    """Run the toy plant on a fake clock until `end` (s); return its record.

    Of its `n` agents the `spares` are not started with the run. `netem` has faults of emulated links, `delay` that of
    every message; `happens` plans, before the run, what people and the machine do.
    """
    plant, agents = toy_configs(n, control, end=end, spares=spares)
    links: dict[str, Any] = {}
    if netem is not None:
        microgrids = {agent.name: agent.microgrid for agent in agents}
        links = EmulationConfig(netem=netem, microgrids=microgrids, real_nodes=True).to_tree()
    plant = replace(plant, clock="realtime", links=links, record=record, wait_for_agents=5.0)
    agents = tuple(replace(agent, clock="realtime", links=links, record=record, deadline=0.0) for agent in agents)
    info = toy_info(plant, agents, level=record)  # in one process: it is written between the calls, in the same parts
    with pytest.MonkeyPatch.context() as patch, Recorder(folder, gaps=True, record=info) as recorder:
        patch.setattr("gridpeers.scenarios.record.record_writer.CHUNK", 20_000)
        run = FakeClockRun(plant, agents, recorder, delay)
        happens(run)
        run.run()
        recorder.finish()
    return RunRecord.open(folder)
