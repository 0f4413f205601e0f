"""The processes of a run: started, watched, and in real time killed and paused as the scenario says."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from time import monotonic

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.children import Child, Children
from gridpeers.scenarios.drivers.forking import agent_server, plant_server
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.wire.messages import PLANT


class FaultInjector:
    """Inject the process faults of a plant's run in real time; telemetry gives the run's time."""

    def __init__(self, plant: PlantConfig) -> None:
        self._due: list[tuple[float, str, signal.Signals]] = []
        """Run time (s), agent and signal of the remaining faults, in the order of time; others are emulated."""
        if plant.links and plant.clock == "realtime":
            setup = EmulationConfig.of_tree(plant.links)
            for node in setup.netem.nodes if setup.real_nodes else ():
                end = math.inf if node.to_s is None else node.to_s
                self._due += [(node.from_s, node.name, signal.SIGKILL)] if node.kill else []
                self._due += [(node.from_s, node.name, signal.SIGSTOP)] if node.pause else []
                self._due += [(end, node.name, signal.SIGCONT)] if node.pause else []
            self._due.sort()
        self._speed, self._T_c = plant.speed, plant.T_c
        self._offset: float | None = None
        """Run time minus real time times the speed (s); None before the run begins."""
        self.killed: set[str] = set()
        self._paused: set[str] = set()

    @property
    def names(self) -> set[str]:
        return {name for _, name, _ in self._due}

    def note_time(self, t: float, at: float) -> None:
        """Note that telemetry of t (s), one period ahead, came at a time of `monotonic` (s); a plant may lag."""
        self._offset = t - self._T_c - at * self._speed

    @property
    def wait(self) -> float:
        """Time (s) until the next fault; infinite if there is none, or the run has not begun."""
        if not self._due or self._offset is None:
            return math.inf
        return max(0.0, (self._due[0][0] - self._offset) / self._speed - monotonic())

    def inject(self, children: Children) -> None:
        while self._due and self.wait == 0.0:
            _, name, number = self._due.pop(0)
            try:
                children[name].signal(number)
            except KeyError:  # its agent has not joined yet
                continue
            if number is signal.SIGKILL:
                self.killed.add(name)
            (self._paused.add if number is signal.SIGSTOP else self._paused.discard)(name)

    def end(self, children: Children) -> None:
        """Drop the faults that are left, and continue paused processes, so that they can leave."""
        self._due.clear()
        for name in self._paused:
            children[name].signal(signal.SIGCONT)
        self._paused.clear()


class Supervisor:
    """Start the plant and its agents, inject the process faults of the scenario; leaving its context ends them all.

    `on_exit`, and `on_word` with the words of the starting plant, are called from other threads. The second life of
    inv1 logs to `inv1-2.log`. Agents share `shared` processes, 0 gives each its own; one that the scenario starts,
    stops, kills or pauses has its own in any case.
    """

    def __init__(
        self,
        plant: PlantConfig,
        agents: Iterable[AgentConfig],
        log_dir: Path,
        on_exit: Callable[[Child], None],
        on_word: Callable[[str], None] | None = None,
        plant_command: Sequence[str] = (),
        shared: int = 0,
    ) -> None:
        self.children = Children()
        self._agents, self._log_dir = {config.name: config for config in agents}, log_dir
        self._on_exit, self._on_word, self._plant_command = on_exit, on_word, plant_command
        self.faults = FaultInjector(plant)
        self._awaited: set[str] = set()
        alone = self.faults.names | {action.inverter for action in plant.schedule}
        self._shared = share(tuple(name for name in self._agents if name not in alone), shared)
        """Agents that share the process of each."""
        self._plant = replace(plant, agent_processes=len({self._mates(name) for name in plant.agents}))

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.faults.end(self.children)
        finally:
            self.children.end()

    def start(self, *names: str) -> None:
        """Start processes, "plant" and names of inverters, each in its next life.

        Agents that share a process start with the first of them. If the plant is the first, the agents do not wait
        until its server is there.
        """
        firsts = [name for name in names if name == self._mates(name)[0]]
        several = len(firsts) > 2  # else a server would take as long as the process itself
        if firsts[:1] != [PLANT]:
            for name in firsts:
                self.children.add(self._child(name, several=several))
            return
        with ThreadPoolExecutor(1) as beside:
            plant = beside.submit(self._child, PLANT, several=several)
            try:
                for name in firsts[1:]:
                    self.children.add(self._child(name, several=several))
            finally:
                self.children.add(plant.result())

    def _child(self, name: str, *, several: bool) -> Child:
        life = len(self.children.lives(name)) + 1
        log = self._log_dir / (f"{name}.log" if life == 1 else f"{name}-{life}.log")
        if name == PLANT:
            usual = ("-m", "gridpeers.scenarios.emulation.emulated_plant" if self._plant.links else "gridpeers.plant")
            command = list(self._plant_command or usual)
            ours = not self._plant_command and self._plant.settings.simulator == "gridpeers"
            server = plant_server() if ours else None
            return Child(name, command, self._plant, log, self._on_exit, self._on_word, server=server)
        configs = tuple(replace(self._agents[mate], epoch=life) for mate in self._mates(name))
        process = configs if len(configs) > 1 else configs[0]
        module = "gridpeers.scenarios.emulation.emulated_agent" if self._agents[name].links else "gridpeers.agents"
        return Child(name, ["-m", module], process, log, self._on_exit, server=agent_server(module, start=several))

    def _mates(self, name: str) -> tuple[str, ...]:
        return self._shared.get(name, (name,))

    def work(self, awaited: Iterable[str] = ()) -> None:
        """Inject the faults that are due, and start agents that the plant awaits, once their former process ended."""
        self._awaited.update(awaited)
        for name in sorted(self._awaited):
            if all(child.status is not None for child in self.children.lives(name)):
                self._awaited.discard(name)
                self.start(name)
        self.faults.inject(self.children)

    def failed(self, child: Child) -> bool:
        """True if a process ended, or still runs, without a reason in the scenario or a request."""
        return (child.status != 0 or child.crashed) and child.name not in self.faults.killed


def share(names: Sequence[str], processes: int) -> dict[str, tuple[str, ...]]:
    """Return the agents that share a process with each, itself included; neighbours in the order stay together."""
    count = min(processes or len(names), len(names))
    bounds = [len(names) * k // count for k in range(count + 1)] if count else [0]
    blocks = [tuple(names[a:b]) for a, b in pairwise(bounds)]
    return {name: block for block in blocks for name in block}
