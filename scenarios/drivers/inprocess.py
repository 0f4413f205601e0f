"""Driver without processes: plant and agents in one thread, with the same cores and so the same bytes as the processes.

Where messages decide something, a bus delivers them in order, encoded and decoded. In all other runs `_run_direct`
takes the same decisions without messages, in a fraction of the time: each tick the plant measures, all agents decide,
and the plant holds their set-points and advances.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from time import perf_counter

import msgspec

from gridpeers.agents.agent_config import AgentConfig, Control
from gridpeers.agents.agent_group import AgentGroup
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.carriers.law_registry import close_laws, make_law
from gridpeers.agents.laws.law import Law
from gridpeers.agents.roster_meeting import KnownAgents
from gridpeers.plant.direct_plant import DirectPlant
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.plant_node import PlantNode
from gridpeers.plant.plant_stepper import PlantStepper
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.run_request import Other, Outcome
from gridpeers.wire.codec import decode
from gridpeers.wire.messages import PLANT, Journal, LinkReport, Nameplate, PlantEvent, Telemetry
from gridpeers.wire.node import Action, Fetch, Listen, Log, Publish


def messages_decide(plant: PlantConfig, agents: Sequence[AgentConfig]) -> bool:
    """Return True if a message may miss its receiver: by an emulated link, or as an agent joins, leaves or dies."""
    emulated = plant.links or any(config.links for config in agents)
    return bool(emulated or plant.schedule or {config.name for config in agents} != set(plant.agents))


def _run_direct(
    config: PlantConfig,
    agents: Sequence[AgentConfig],
    laws: Sequence[Law],
    plant: PlantLike,
    on_telemetry: Callable[[Telemetry], None],
    on_other: Callable[[Other], None],
) -> PlantStepper:
    core = DirectPlant(config, plant, on_telemetry, on_other)
    place = {name: i for i, name in enumerate(config.agents)}
    order = sorted(range(len(agents)), key=lambda i: place[agents[i].name])
    group = AgentGroup([agents[i] for i in order], [laws[i] for i in order])
    while not core.finished:
        core.end_tick(group.tick(core.begin_tick()))
        for journal in group.take_journals():
            on_other(journal)
    return core.stepper


_Node = PlantNode | AgentNode


class InprocessBus:
    """Plant and agents as the nodes that processes have; it delivers their messages in the order of publication."""

    def __init__(
        self,
        config: PlantConfig,
        agents: Sequence[AgentConfig],
        laws: list[Law],
        plant: PlantLike,
        on_telemetry: Callable[[Telemetry], None],
        on_other: Callable[[Other], None],
    ) -> None:
        self.plant = PlantNode(config, plant, links_of(PLANT, config.links))
        self.agents: list[AgentNode] = []
        """All agents so far, also those that have stopped; their laws are added to `laws`."""
        self._configs, self._laws = {agent.name: agent for agent in agents}, laws
        self._known = KnownAgents(agents[0].control if agents else Control(secondary="none", graph="none"))
        self._running = [self._agent(agent.name) for agent in agents if agent.name in config.agents]
        self._awaited: list[str] = []
        self._on_telemetry, self._on_other = on_telemetry, on_other
        self._subscribers: defaultdict[str, list[_Node]] = defaultdict(list)
        self._telemetry = self.plant.keys.telemetry
        self._nameplates: dict[str, bytes] = {}
        self._queue: deque[tuple[tuple[_Node, ...], str, bytes]] = deque()
        """Messages on their way: receivers, key and bytes."""

    def _agent(self, name: str) -> AgentNode:
        config = self._configs[name]
        assert config.control == self._known.control
        self._laws.append(make_law(config.control))
        links = links_of(name, config.links)
        self.agents.append(AgentNode(config, f"p{len(self.agents)}", links, self._laws[-1], self._known))
        return self.agents[-1]

    def run(self) -> None:
        """Run until the plant is over. There is no clock: `now` is 0, and no deadline passes."""
        plant = self.plant
        plant.start(0.0)
        for agent in self._running:
            self._start(agent)
        while not plant.finished:
            self._do(plant, plant.take_actions())
            while self._queue:
                receivers, key, payload = self._queue.popleft()
                for to in receivers:
                    to.received(key, payload, 0.0)
                    if actions := to.take_actions():
                        self._do(to, actions)
            self._end_the_stopped()
            awaited, self._awaited = self._awaited, []
            for name in awaited:
                config = self._configs[name]
                self._configs[name] = msgspec.structs.replace(config, epoch=config.epoch + 1)
                self._running.append(self._agent(name))
                self._start(self._running[-1])
            if not (plant.finished or plant.work(0.0) or self._queue):
                missing = "; ".join(f"{what} from {who}" for what, who in plant.missing_messages()[:5])
                raise AssertionError(f"stalled in phase {plant.phase} at tick {plant.stepper.tick} without {missing}")
        self._do(plant, plant.take_actions())

    def _start(self, agent: AgentNode) -> None:
        """Start an agent: it and the plant see each other, and it is introduced to all agents at once."""
        agent.start(0.0)
        keys = self.plant.keys
        for key in agent.subscriptions:
            self._subscribers[key].append(agent)
        nameplate, answer = agent.nameplate
        self._nameplates[nameplate] = answer
        _, _, inverter, instance = keys.parts(agent.token)
        for key in (keys.state(inverter), keys.ready(inverter), keys.report(inverter), keys.journal(inverter)):
            if self.plant not in self._subscribers[key]:
                self._subscribers[key].append(self.plant)
        self.plant.appeared(agent.token, 0.0)
        self._do(self.plant, self.plant.take_actions())
        agent.appeared(self.plant.token, 0.0)
        introduced = decode(answer)
        assert isinstance(introduced, Nameplate)
        self._known.members.appeared(inverter, instance)
        self._known.members.meet(instance, introduced)
        self._do(agent, agent.take_actions())

    def _do(self, side: _Node, actions: Sequence[Action | Log]) -> None:
        for action in actions:
            if isinstance(action, Publish):
                key, payload = action
                if receivers := self._subscribers.get(key):
                    self._queue.append((tuple(receivers), key, payload))
                if key == self._telemetry:
                    message = decode(payload)
                    if isinstance(message, Telemetry):
                        self._awaited += message.awaited
                        self._on_telemetry(message)
                    elif isinstance(message, LinkReport | Journal):
                        self._on_other(message)
            elif isinstance(action, Fetch):
                if action.key in self._nameplates:
                    self._queue.append(((side,), action.key, self._nameplates[action.key]))
            elif isinstance(action, Listen):
                self._subscribers[action.key].append(side)

    def _end_the_stopped(self) -> None:
        stopped = {agent for agent in self._running if agent.finished}
        if not stopped:
            return
        self._running = [agent for agent in self._running if not agent.finished]
        for receivers in self._subscribers.values():
            receivers[:] = [node for node in receivers if node not in stopped]
        for agent in stopped:
            self._nameplates.pop(agent.nameplate[0])
            self.plant.vanished(agent.token, 0.0)
            self._known.members.vanished(*self.plant.keys.parts(agent.token)[2:])
            for other in self._running:
                other.vanished(agent.token, 0.0)


def run_inprocess(
    plant_config: PlantConfig,
    agent_configs: Iterable[AgentConfig],
    on_telemetry: Callable[[Telemetry], None],
    *,
    on_other: Callable[[Other], None] = lambda message: None,
    plant: PlantLike | None = None,
    messages: bool = False,
) -> Outcome:
    """Run a scenario in this process and this thread.

    A given `plant` is used instead of building the configuration's. With `messages`, plant and agents exchange them
    even where these decide nothing. A plant without solution is an outcome, a bad feeder or name an exception.
    """
    began = perf_counter()
    started = began
    events: list[PlantEvent] = []

    def note(telemetry: Telemetry) -> None:
        nonlocal started
        if started == began:
            started = perf_counter()
        events.extend(telemetry.events)
        on_telemetry(telemetry)

    configs = tuple(agent_configs)
    laws: list[Law] = []
    bus: InprocessBus | None = None
    with ExitStack() as stack:
        if plant is None:
            from gridpeers.plant.build import start_plant  # numba and scipy: only for who runs a plant

            try:
                plant = start_plant(plant_config)
            except RuntimeError as error:
                why, took = f"plant: cannot start: {error}", perf_counter() - began
                return Outcome(broke=why, reproducible=False, events=(), notes=(), ticks=0, start_s=took, run_s=0.0)
            stack.callback(plant.close)
        stack.callback(close_laws, laws)
        plant_config = msgspec.structs.replace(plant_config, recorders=())
        if messages or messages_decide(plant_config, configs):
            bus = InprocessBus(plant_config, configs, laws, plant, note, on_other)
            bus.run()
            stepper = bus.plant.stepper
        else:
            for config in configs:  # one by one: those that are made are closed if the next cannot be
                laws.append(make_law(config.control))
            stepper = _run_direct(plant_config, configs, laws, plant, note, on_other)
    notes: list[str] = []
    if bus is not None:
        notes += [agent.failed for agent in bus.agents if agent.failed]
        nodes: list[_Node] = [bus.plant, *bus.agents]
        notes += [line for node in nodes for line in node.rejects.take_lines()]
    return Outcome(
        broke=stepper.outcome,
        reproducible=stepper.reproducible,
        events=tuple(events),
        notes=tuple(notes),
        ticks=stepper.tick,
        start_s=started - began,
        run_s=perf_counter() - started,
    )
