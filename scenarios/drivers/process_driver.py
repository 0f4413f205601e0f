"""Driver with processes: starts the plant and one process per agent, watches them, and ends them, whatever happens.

The fleet decides nothing about the run. It records the plant's telemetry like any other peer could, and notices deaths.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from time import monotonic

import msgspec

from agents.agent_config import AgentConfig
from plant.plant_config import PlantConfig
from plant.plant_process import READY
from scenarios.drivers.children import Child, Children
from scenarios.drivers.fault_injector import FaultInjector
from scenarios.drivers.outcome import Outcome
from scenarios.drivers.rendezvous import rendezvous
from scenarios.drivers.telemetry_client import TelemetryClient, Word
from wire.messages import PLANT, LinkOrder, LinkReport, PlantEvent, Telemetry

RECORDER = "fleet"
"""Name of the fleet's recorder in its run."""

BUILD_DEADLINE = 600.0
"""Longest time (s) until the plant must stand; compiling the step at the very first start takes up to a minute."""

LEAVING = 2.5
"""Time (s) that processes have to close at the end by themselves."""

AFTERMATH = 0.3
"""The same when the run broke: who died of it is noticed in this time, the others are ended."""

STOOD_STILL = 1.0
"""Time (s) by which a wait may be longer than asked for before this process counts as having stood still itself."""

_EXIT, _WORD = "exit/", "word/"


def run_processes(
    plant_config: PlantConfig,
    agent_configs: Iterable[AgentConfig],
    log_dir: Path,
    on_telemetry: Callable[[Telemetry], None],
    *,
    start_order: Sequence[str] | None = None,
    on_status: Callable[[str], None] | None = None,
    on_start: Callable[[Children], None] | None = None,
    on_links: Callable[[LinkReport], None] = lambda report: None,
    plant_command: Sequence[str] = (),
) -> Outcome:
    """Run a scenario with a plant process and one process per agent, in simulated or in wall-clock time.

    In wall-clock time the plant ends the run after end / speed, an agent that dies is only an event, and whom the
    scenario kills or pauses really is. Who joins, or joins again, is started when the plant says so.

    Parameters
    ----------
    plant_config : PlantConfig
        The plant. Its `listen` is used if it names a port other than 0, else a free port is chosen.
    agent_configs : Iterable[AgentConfig]
        The agents, also those that join later; where they connect is filled in.
    log_dir : Path
        Folder for `plant.log`, `inv1.log`, ...; made if it does not exist.
    on_telemetry : Callable[[Telemetry], None]
        Called with every telemetry message as it comes; the first at t = 0.
    start_order : Sequence[str], optional
        Names in the order of their start; the plant, named "plant", first unless said otherwise.
    on_status : Callable[[str], None], optional
        Called with "listening", "compiling", "ready" as the plant comes up.
    on_start : Callable[[Children], None], optional
        Called once all processes are started; the tests' way to hurt them.
    on_links : Callable[[LinkReport], None], optional
        Called with every part of what the emulated links did.
    plant_command : Sequence[str], optional
        How the interpreter is told to run the plant, if not as usual; tests have smaller ones.

    Returns
    -------
    Outcome
        How it ended.

    Raises
    ------
    SessionError
        If the port is in use or Zenoh is missing; nothing has been started then.
    """
    agents = {config.name: config for config in agent_configs}
    wall = plant_config.clock == "wall"
    patience = "deadline" if wall else "plant_wait"  # who waits for the plant waits for its compiler too
    agents = {name: msgspec.structs.replace(config, **{patience: BUILD_DEADLINE}) for name, config in agents.items()}
    endpoint = rendezvous(plant_config.listen)
    plant_config = msgspec.structs.replace(plant_config, listen=(endpoint,), recorders=(RECORDER,))
    first = [name for name in agents if name in plant_config.agents]
    order = list(start_order) if start_order is not None else [PLANT, *first]
    if sorted(order) != sorted([PLANT, *first]):
        raise ValueError(f"start_order: must name {PLANT} and every agent once, got {', '.join(order)}")
    log_dir.mkdir(parents=True, exist_ok=True)
    client = TelemetryClient(RECORDER, plant_config.run, endpoint, plant_config.clock)
    try:

        def start(name: str, life: int) -> Child:
            return _start(name, life, plant_config, agents, endpoint, log_dir, plant_command, client)

        watch = _Watch(client, plant_config, on_telemetry, on_links, on_status or (lambda word: None), start)
        with Children() as children:
            for name in order:
                children.add(start(name, 1))
            if on_start is not None:
                on_start(children)
            watch.until_the_end(children)
            client.close()  # with it goes the recorder's token: the plant knows that the last telemetry is here
            children.wait(AFTERMATH if watch.broke else LEAVING)
            watch.note_failures(children)
        return watch.outcome()
    finally:
        client.close()


def _start(
    name: str,
    life: int,
    plant_config: PlantConfig,
    agents: dict[str, AgentConfig],
    endpoint: str,
    log_dir: Path,
    plant_command: Sequence[str],
    client: TelemetryClient,
) -> Child:
    def on_exit(child: Child) -> None:
        client.say(f"{_EXIT}{child.pid}")

    def on_word(word: str) -> None:
        client.say(_WORD + word)

    log = log_dir / (f"{name}.log" if life == 1 else f"{name}-{life}.log")
    if name == PLANT:
        usual = ("-m", "scenarios.emulation.emulated_plant" if plant_config.links else "plant")
        return Child(name, list(plant_command or usual), plant_config, log, on_exit, on_word)
    config = msgspec.structs.replace(agents[name], connect=(endpoint,), incarnation=life)
    return Child(name, ["-m", "scenarios.emulation.emulated_agent" if config.links else "agents"], config, log, on_exit)


class _Watch:
    """What the fleet has seen of the run so far."""

    def __init__(
        self,
        client: TelemetryClient,
        config: PlantConfig,
        on_telemetry: Callable[[Telemetry], None],
        on_links: Callable[[LinkReport], None],
        on_status: Callable[[str], None],
        start: Callable[[str, int], Child],
    ) -> None:
        self.broke = ""
        self._start = start
        self._awaited: set[str] = set()
        """Agents that the scenario lets join, and whose process is yet to be started."""
        self._client, self._T_c = client, config.T_c
        self._wall = config.clock == "wall"
        self._misfortunes = FaultInjector(config.links if self._wall else "", config.speed)
        self._patience = 1.5 * config.deadline + 1.0
        """Longer than the plant's: it knows better what is wrong, unless it is what is wrong."""
        if self._wall:
            self._patience += config.wait_for_agents + 2.0 * config.T_c / config.speed
        self._on_telemetry, self._on_links, self._on_status = on_telemetry, on_links, on_status
        self._began = self._started = self._ended_at = monotonic()
        self._standing = False
        self._last: Telemetry | None = None
        self._t, self._ticks = 0.0, 0
        self._ended = False
        self._events: list[PlantEvent] = []
        self._notes: dict[str, str] = {}

    def until_the_end(self, children: Children) -> None:
        """Take in everything until the last telemetry, or until the run cannot go on."""
        since = self._began
        while not self._ended:
            patience = self._patience if self._standing else BUILD_DEADLINE
            limit = min(patience, self._misfortunes.wait)
            asked = monotonic()
            items = self._client.take(limit)
            now = monotonic()
            if items or now - asked > limit + STOOD_STILL:  # who has stood still itself has not waited
                since = now
            elif now - since >= patience:
                report = children[PLANT].report(self._when)
                self._break(f"nothing was heard of the plant for {patience:g} s, so the run was ended: {report}")
            for item in items:
                if not isinstance(item, Word):
                    self._take(item)
                elif item.text.startswith(_EXIT):
                    self._note_exit(
                        next(child for child in children if str(child.pid) == item.text.removeprefix(_EXIT))
                    )
                else:
                    self._standing = self._standing or item.text == _WORD + READY
                    self._on_status(item.text.removeprefix(_WORD))
            self._start_the_awaited(children)
            self._misfortunes.strike(children)
        self._misfortunes.end(children)

    def _start_the_awaited(self, children: Children) -> None:
        """Start whom the plant awaits, once the former process of the name has really ended."""
        for name in sorted(self._awaited):
            lives = children.lives(name)
            if self._ended or any(child.status is None for child in lives):
                continue
            self._awaited.discard(name)
            children.add(self._start(name, len(lives) + 1))

    def _take(self, telemetry: Telemetry | LinkReport | LinkOrder) -> None:
        if isinstance(telemetry, LinkReport):
            self._on_links(telemetry)
        if not isinstance(telemetry, Telemetry):
            return
        if self._last is None:
            self._started = monotonic()
        self._last = telemetry
        self._t = telemetry.t
        if telemetry.rows and not telemetry.final:
            self._misfortunes.heard(telemetry.t - self._T_c, monotonic())  # it is a step ahead
        self._ticks = round(telemetry.t / self._T_c)
        self._events += telemetry.events
        self._awaited.update(telemetry.awaited)
        self._on_telemetry(telemetry)
        if telemetry.final:
            self._break(telemetry.outcome)

    def _note_exit(self, child: Child) -> None:
        if self._ended:
            return
        if child.name in self._misfortunes.killed:
            return  # as the scenario says; the plant tells it as an event
        if child.name != PLANT and child.status == 0:
            return  # it was asked to leave, perhaps by a Stop that is faster than the telemetry which goes with it
        report = child.report(self._when)
        if child.name == PLANT or (self._last is None and not self._wall):
            self._break(report)
        else:
            self._notes[child.name] = report

    def _break(self, reason: str) -> None:
        """Note the end of the run; it is a good one if there is no reason."""
        self.broke, self._ended, self._ended_at = reason, True, monotonic()

    @property
    def _when(self) -> str:
        return "before t = 0" if self._last is None else f"after t = {self._t:g} s"

    def note_failures(self, children: Children) -> None:
        """Note who ended badly, or has not ended though the run has."""
        for child in children:
            told = child.name in self._notes or child.name == PLANT or child.name in self._misfortunes.killed
            if child.status != 0 and not told and not (self.broke and child.status is None):
                self._notes[child.name] = child.report(self._when)

    def outcome(self) -> Outcome:
        """How the run ended, when all processes have."""
        now = monotonic()
        started = now if self._last is None else self._started
        return Outcome(
            broke=self.broke,
            reproducible=self._last is not None and self._last.reproducible and not self.broke,
            events=tuple(self._events),
            notes=(*self._notes.values(), *self._client.rejects.take_lines()),
            ticks=self._ticks,
            start_s=started - self._began,
            run_s=self._ended_at - started,
            pacing=None if self._last is None else self._last.pacing,
        )
