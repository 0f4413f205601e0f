"""One supervisor for the processes of every run: of `gridpeers run` and of `gridpeers up`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType, TracebackType

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.children import Child, Children
from gridpeers.scenarios.drivers.fault_injector import FaultInjector
from gridpeers.scenarios.drivers.warm_servers import agent_server, plant_server
from gridpeers.wire.messages import PLANT


class Supervisor:
    """Start the plant and its agents, inject the process faults of the scenario, and end every process.

    Use it as a context: leaving it ends all processes. One thread owns it; `on_exit` and `on_word` come from others.

    Parameters
    ----------
    plant : PlantConfig
        The plant.
    agents : Iterable[AgentConfig]
        All agents, also those that join later, with their endpoints.
    log_dir : Path
        Folder for `plant.log`, `inv1.log`, ...; the second life of inv1 writes `inv1-2.log`.
    on_exit : Callable[[Child], None]
        Called with every process that has ended.
    on_word : Callable[[str], None], optional
        Called with "listening", "compiling", "ready" as the plant comes up.
    plant_command : Sequence[str], optional
        Arguments of the interpreter for another plant than the usual one.
    prefixes : Mapping[str, Sequence[str]], optional
        By agent, what stands before its command, e.g. to run it on another host.
    shared : int, optional
        Number of processes that agents share; 0 gives each agent its own. An agent that the scenario starts, stops,
        kills or pauses has its own in any case.
    """

    def __init__(
        self,
        plant: PlantConfig,
        agents: Iterable[AgentConfig],
        log_dir: Path,
        on_exit: Callable[[Child], None],
        on_word: Callable[[str], None] | None = None,
        plant_command: Sequence[str] = (),
        prefixes: Mapping[str, Sequence[str]] = MappingProxyType({}),
        shared: int = 0,
    ) -> None:
        self.children = Children()
        self._agents, self._log_dir = {config.name: config for config in agents}, log_dir
        self._on_exit, self._on_word, self._plant_command, self._prefixes = on_exit, on_word, plant_command, prefixes
        self._faults = FaultInjector(plant.links if plant.clock == "wall" else {}, plant.speed)
        self._awaited: set[str] = set()
        alone = self._faults.names | {action.inverter for action in plant.schedule} | set(prefixes)
        self._shared = share(tuple(name for name in self._agents if name not in alone), shared)
        """Agents that share the process of each."""
        self._plant = replace(plant, agent_processes=len({self._mates(name) for name in plant.agents}))

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            self.end_faults()
        finally:
            self.children.end()

    def start(self, *names: str) -> None:
        """Start processes: the plant as "plant", agents by the name of their inverter, each in its next life.

        Agents that share a process start with the first of them. The plant and the agents are forked from processes
        that have imported what they need. If the plant is the first, the agents do not wait until its server is there.
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
        """Start the next life of a name, one of several or alone."""
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
        prefix = self._prefixes.get(name, ())
        module = self._module(name)
        server = None if prefix else agent_server(module, start=several)
        return Child(name, ["-m", module], process, log, self._on_exit, prefix=prefix, server=server)

    def _mates(self, name: str) -> tuple[str, ...]:
        """Return the agents that share the process of one, itself included."""
        return self._shared.get(name, (name,))

    def _module(self, name: str) -> str:
        """Return the module of an agent's process."""
        return "gridpeers.scenarios.emulation.emulated_agent" if self._agents[name].links else "gridpeers.agents"

    def start_when_gone(self, names: Iterable[str]) -> None:
        """Start agents that the plant awaits, as soon as the former process of their name has ended."""
        self._awaited.update(names)

    def note_time(self, t: float, at: float) -> None:
        """Note that telemetry of t (s of run time) came at a time of `monotonic` (s); it is one period ahead."""
        self._faults.note_time(t - self._plant.T_c, at)

    @property
    def wait(self) -> float:
        """Time (s) until the next process fault; infinite if there is none."""
        return self._faults.wait

    def work(self) -> None:
        """Start the awaited agents whose former process has ended, and inject the faults that are due."""
        for name in sorted(self._awaited):
            if all(child.status is not None for child in self.children.lives(name)):
                self._awaited.discard(name)
                self.start(name)
        self._faults.inject(self.children)

    def end_faults(self) -> None:
        """Inject no more faults, and continue paused processes."""
        self._faults.end(self.children)

    def failed(self, child: Child) -> bool:
        """Whether a process has ended, or still runs, though neither the scenario nor a request explains it."""
        return (child.status != 0 or child.crashed) and child.name not in self._faults.killed


def share(names: Sequence[str], processes: int) -> dict[str, tuple[str, ...]]:
    """Return the agents that share a process with each, itself included; neighbours in the order stay together.

    Examples
    --------
    >>> share(("inv1", "inv2", "inv3", "inv4"), 2)["inv2"]
    ('inv1', 'inv2')
    >>> share(("inv1", "inv2", "inv3"), 0)["inv2"]
    ('inv2',)
    """
    count = min(processes or len(names), len(names))
    bounds = [len(names) * k // count for k in range(count + 1)] if count else [0]
    blocks = [tuple(names[a:b]) for a, b in pairwise(bounds)]
    return {name: block for block in blocks for name in block}
