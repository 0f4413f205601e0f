"""Driver with processes: run the plant and its agents, take their telemetry, and end them in every case.

The driver decides nothing about the run. It takes the plant's telemetry as any other peer could, and notices deaths.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.known_names import READY
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.children import Child, Children
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.drivers.supervisor import Supervisor
from gridpeers.scenarios.drivers.telemetry_client import LOOK, RECORDER, TelemetryClient, with_recorder
from gridpeers.scenarios.drivers.telemetry_stream import Recordable
from gridpeers.scenarios.run_request import Other, Outcome
from gridpeers.wire.messages import PLANT, PlantEvent, Telemetry

BUILD_DEADLINE = 600.0  # Longest time (s) until the plant is ready; the very first start may compile for a minute
LEAVING = 10.0  # Time (s) for processes to close at the end by themselves; most take 0.1 s, on a busy machine up to 3 s
AFTERMATH = 0.3  # The same after the run broke: processes that fail with it end in this time, the others are then ended
LAST_TELEMETRY = 2.0  # Longest wait (s) for the last telemetry of a plant after its process ended in order
STOOD_STILL = 1.0  # Excess (s) of a wait over its limit, after which this process counts as stopped itself


def run_processes(
    plant_config: PlantConfig,
    agent_configs: Iterable[AgentConfig],
    log_dir: Path,
    on_telemetry: Callable[[Telemetry], None],
    *,
    start_order: Sequence[str] | None = None,
    on_start: Callable[[Children], None] | None = None,
    on_other: Callable[[Other], None] = lambda message: None,
    plant_command: Sequence[str] = (),
    shared: int = 0,
    star: bool = True,
) -> Outcome:
    """Run a scenario with a plant process and processes of agents, in simulated or in real time.

    In real time the death of an agent is only an event, and the scenario's kills and pauses are real signals. The plant
    listens at its `listen`, or at a free port. `on_start` is called once all processes are started, in the
    `start_order`. Agents share `shared` processes, 0 gives each its own. `star` lets all processes link to the plant
    alone in simulated time (docs/reference/protocol.md). ListenError or SessionError, with nothing started, if the port
    is in use or Zenoh is missing.
    """
    agents = {config.name: config for config in agent_configs}
    realtime = plant_config.clock == "realtime"
    endpoint = free_endpoint(*plant_config.listen[:1])
    deadline = "deadline" if realtime else "plant_wait"  # an agent that waits for the plant waits for its compiler too
    star = star and not realtime
    own: dict[str, Any] = {deadline: BUILD_DEADLINE, "connect": (endpoint,), "star": star}
    if plant_config.credentials is not None:
        own["listen"] = ("tls/127.0.0.1:0",)
    configs = [replace(config, **own) for config in agents.values()]
    plant_config = replace(with_recorder(plant_config), listen=(endpoint,), star=star)
    first = [PLANT, *(name for name in agents if name in plant_config.agents)]
    order = first if start_order is None else list(start_order)
    if sorted(order) != sorted(first):
        raise ValueError(f"start_order: must name {PLANT} and every agent once, got {', '.join(order)}")
    log_dir.mkdir(parents=True, exist_ok=True)
    driver = _ProcessDriver(plant_config, on_telemetry, on_other)
    try:
        with Supervisor(
            plant_config, configs, log_dir, driver.on_exit, driver.on_word, plant_command, shared=shared
        ) as supervisor:
            supervisor.start(*order)
            if on_start is not None:
                on_start(supervisor.children)
            driver.run(supervisor)
            driver.client.close()  # with it goes the recorder's token: the plant knows that the last telemetry is here
            supervisor.children.wait(driver.patience)
            driver.note_failures(supervisor)
        return driver.outcome()
    finally:
        driver.client.close()


class _ProcessDriver:
    """Follow a run from its telemetry and the exits of its processes, until it ends or cannot go on."""

    def __init__(
        self, config: PlantConfig, on_telemetry: Callable[[Telemetry], None], on_other: Callable[[Other], None]
    ) -> None:
        self.client = TelemetryClient(
            RECORDER, config.run, config.listen[0], config.clock, self._take, config.credentials
        )
        self._broke = ""
        """Why the run broke; "" after a good end."""
        self._T_c, self._realtime = config.T_c, config.clock == "realtime"
        self._plant_deadline = 1.5 * config.deadline + 1.0
        """Longer than the plant's own (s): the plant reports better what is wrong, unless it is the cause itself."""
        if self._realtime:
            self._plant_deadline += config.wait_for_agents + 2.0 * config.T_c / config.speed
        self._on_telemetry, self._on_other = on_telemetry, on_other
        self._began = self._ended_at = monotonic()
        self._started: float | None = None
        self._plant_ready = self._ended = False
        self._left: Child | None = None
        """The process that ended in order, so that the plant's last telemetry is still to come."""
        self._left_at = inf
        """When it did so (s, monotonic)."""
        self._events: list[PlantEvent] = []
        self._awaited: list[str] = []
        self._notes: dict[str, str] = {}

    def on_exit(self, child: Child) -> None:
        self.client.say(str(child.pid))

    def on_word(self, word: str) -> None:
        if word == READY:
            self.client.say(READY)

    @property
    def patience(self) -> float:
        return AFTERMATH if self._broke else LEAVING

    def run(self, supervisor: Supervisor) -> None:
        client, since = self.client, self._began
        while not self._ended:
            deadline = self._plant_deadline if self._plant_ready else BUILD_DEADLINE
            limit = min(deadline, supervisor.faults.wait, LAST_TELEMETRY if self._left is not None else deadline)
            asked = monotonic()
            words = client.take(limit)
            now = monotonic()
            if words or now - asked > min(limit, LOOK) + STOOD_STILL:  # who stood still itself has not waited
                since = now
            elif now - max(since, client.message_at) >= deadline:
                report = supervisor.children[PLANT].report(self._when)
                self._end(f"the plant was silent for {deadline:g} s, so the run was ended: {report}")
            for word in words:
                if word == READY:
                    self._plant_ready = True
                elif not self._ended:
                    self._note_exit(next(one for one in supervisor.children if str(one.pid) == word), supervisor)
            if client.progress is not None:
                supervisor.faults.note_time(*client.progress)
            if self._left is not None and not self._ended and now - self._left_at > LAST_TELEMETRY:
                self._end(self._left.report(self._when))
            if not self._ended:
                supervisor.work(self._awaited)
                self._awaited.clear()
        supervisor.faults.end(supervisor.children)
        until = monotonic() + self.patience
        # in simulated time the plant leaves once its last telemetry is acknowledged
        while not self._realtime and supervisor.children[PLANT].status is None and (left := until - monotonic()) > 0.0:
            client.take(left)

    def _take(self, message: Recordable) -> None:
        if not isinstance(message, Telemetry):
            self._on_other(message)
            return
        if self._started is None:
            self._started = monotonic()
        self._events += message.events
        self._awaited += message.awaited
        self._on_telemetry(message)
        if message.final:
            self._end(message.outcome)

    def _note_exit(self, child: Child, supervisor: Supervisor) -> None:
        begun = self.client.latest is not None
        # in simulated time a run does not begin without one of its agents
        ends_it = child.name == PLANT if begun else child.name != PLANT and not self._realtime
        if child.status == 0 and ends_it:
            if self._left is None:
                self._left, self._left_at = child, monotonic()
        elif child.name == PLANT or (supervisor.failed(child) and not self._realtime and (child.crashed or not begun)):
            self._end(child.report(self._when))
        elif supervisor.failed(child):
            self._notes[child.name] = child.report(self._when)
            if child.crashed:
                self.client.note_crash(child.name, child.end)
        # else it was asked to leave, perhaps by a Stop that is faster than its telemetry, or the scenario killed it

    def _end(self, reason: str) -> None:
        self._broke, self._ended, self._ended_at = reason, True, monotonic()

    @property
    def _when(self) -> str:
        return "before t = 0" if self.client.latest is None else f"after t = {self.client.t:g} s"

    def note_failures(self, supervisor: Supervisor) -> None:
        """Note every agent that failed, or has not ended; one that crashed before the end of the run breaks it.

        In simulated time a run may reach its end before the exit of a process is noticed.
        """
        unscripted = self.client.latest is not None and not self.client.latest.reproducible and not self._realtime
        died = {event.subject: event.t for event in self._events if event.kind == "roster" and unscripted}
        for child in supervisor.children:
            known = child.name in self._notes or child.name == PLANT or (self._broke and child.status is None)
            if child.crashed and child.name in died and not self._broke:
                self._broke = child.report(f"at t = {died[child.name]:g} s")
            elif supervisor.failed(child) and not known:
                self._notes[child.name] = child.report(self._when)

    def outcome(self) -> Outcome:
        last, started = self.client.latest, self._started or monotonic()
        return Outcome(
            broke=self._broke,
            reproducible=last is not None and last.reproducible and not self._broke,
            events=tuple(self._events),
            notes=(*self._notes.values(), *self.client.rejects.take_lines()),
            ticks=round(self.client.t / self._T_c),
            start_s=started - self._began,
            run_s=self._ended_at - started,
            pacing=None if last is None else last.pacing,
        )
