"""A run of real processes in real time around the toy plant, and an observer who only waits for messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.drivers.supervisor import Supervisor
from gridpeers.scenarios.results.link_record import LinkRecord
from gridpeers.scenarios.schema.configs import secured
from gridpeers.wire.codec import RejectedError, decode, encode
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import (
    PLANT,
    AgentStatus,
    Answer,
    Command,
    LinkAcknowledgement,
    LinkReport,
    LinkRequest,
    PlantEvent,
    State,
    Telemetry,
)
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_runs import TOY, exists

PATIENCE = 60.0
"""Longest wait (s) for anything; a busy machine is slow, and nothing here should take a thirtieth of it.

A plant that ends by itself with an error ends the wait at once.
"""


class Town:
    """A plant, its agents and an observer. Nothing is started until it is asked for.

    With `keys_folder`, a folder of certificates, links are TLS, and the observer has the plant's. `also` has endpoints
    that agents connect to beside the plant's; `changes` are fields of the plant's configuration.
    """

    def __init__(
        self,
        n: int,
        folder: Path,
        *,
        run: str = "toy",
        spares: tuple[str, ...] = (),
        also: tuple[str, ...] = (),
        links: dict[str, Any] | None = None,
        configs: tuple[PlantConfig, tuple[AgentConfig, ...]] | None = None,
        plant_command: Sequence[str] = TOY,
        keys_folder: Path | None = None,
        **changes: Any,
    ) -> None:
        plant, agents = toy_configs(n, run=run) if configs is None else configs
        run, links = plant.run, links or plant.links
        self.endpoint = free_endpoint() if keys_folder is None else free_endpoint("tls/127.0.0.1:0")
        self.plant_config = replace(
            plant,
            clock="realtime",
            end=None,
            listen=(self.endpoint,),
            links=links,
            settings=replace(plant.settings, spares=spares),
            agents=tuple(name for name in plant.agents if name not in spares),
        )
        self.plant_config = replace(self.plant_config, **changes)
        connect = (self.endpoint, *also)
        self.agent_configs = {
            config.name: replace(config, clock="realtime", connect=connect, deadline=PATIENCE, links=links)
            for config in agents
        }
        beside = "tcp/127.0.0.1:0"
        if keys_folder is not None:
            beside = "tls/127.0.0.1:0"
            names = tuple(self.agent_configs)
            self.plant_config, secured_agents, _ = secured(
                self.plant_config,
                [replace(config, listen=(beside,)) for config in self.agent_configs.values()],
                keys_folder,
                started=[name for name in names if (keys_folder / f"{name}.key").is_file()],
                inverters=names,
            )
            self.agent_configs = {config.name: config for config in secured_agents}
        self.keys = Keys(run)
        self.folder = folder
        self.supervisor = Supervisor(
            self.plant_config, self.agent_configs.values(), folder, self._ended, plant_command=plant_command
        )
        self.children = self.supervisor.children
        self._signalled: set[int] = set()
        self.status: dict[str, AgentStatus] = {}
        self.states: dict[str, State] = {}
        self.events: list[PlantEvent] = []
        self.rows: list[tuple[float, ...]] = []
        self.telemetry: Telemetry | None = None
        self.answers: list[Answer] = []
        self.acknowledgements: list[LinkAcknowledgement] = []
        self.orders: list[LinkRequest] = []
        self.link_record = LinkRecord()
        self.tokens: set[str] = set()
        self.session = Session(
            "observer", listen=(beside,), connect=connect, clock="realtime", credentials=self.plant_config.credentials
        )
        for name in self.agent_configs:
            self.session.subscribe(self.keys.status(name))
            self.session.subscribe(self.keys.state(name))
        self.session.subscribe(self.keys.telemetry)
        self.session.subscribe(self.keys.answer("observer"))
        self.session.watch(self.keys.any_alive)

    def __enter__(self) -> Town:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.session.close()
        self.children.end()
        assert [child.pid for child in self.children if exists(child.pid)] == []

    def start(self, *names: str) -> Town:
        """Start the plant ("plant") or agents; a name that has run before is started anew."""
        for child in self.children:
            if child.name in names:
                child.release()
        self.supervisor.start(*names)
        return self

    def add(self, name: str, command: list[str], config: Any) -> Child:
        """Start one process with a configuration of its own, whose log is named after it."""
        child = Child(name, command, config, self.folder / f"{name}-own.log", self._ended)
        self.children.add(child)
        return child

    def all(self) -> Town:
        """Start everything and wait until every agent ticks with all others in its sums."""
        self.start("plant", *self.plant_config.agents)
        return self.together(self.plant_config.agents)

    def together(self, names: tuple[str, ...]) -> Town:
        return self.until(
            lambda: all(name in self.status and set(self.status[name].used) == {*names} - {name} for name in names),
            f"{', '.join(names)} use each other",
        )

    def log(self, name: str) -> str:
        return (self.folder / f"{name}.log").read_text()

    def signal(self, name: str, number: int) -> None:
        self._signalled.add(self.children[name].pid)
        self.children[name].signal(number)

    def command(self, verb: Any, argument: str | dict[str, Any] = "") -> Answer:
        """Send the plant a command with a name, or with a command to links, and wait for its answer."""
        count = len(self.answers)
        command = Command(
            sender="observer",
            epoch=1,
            seq=count,
            t=0.0,
            verb=verb,
            reply_to="observer",
            **({"argument": argument} if isinstance(argument, str) else {"link_command": argument}),
        )
        self.session.publish(self.keys.command, encode(command))
        self.until(lambda: len(self.answers) > count, f"answer to {verb}")
        return self.answers[-1]

    def until(self, condition: Callable[[], bool], what: str, patience: float = PATIENCE) -> Town:
        end = monotonic() + patience
        while not condition():
            left = end - monotonic()
            assert left > 0.0, f"not within {patience:g} s: {what}; {self}"
            broke = self._plant_broke()  # asked before the last messages are taken, of which one may be awaited
            events = self.session.inbox.take(1, 1.0 if broke else left)
            for kind, key, payload, _ in events:
                self._take(kind, key, payload)
            assert events or not broke or condition(), f"{broke}\nIn vain: {what}; {self}"
        return self

    def _plant_broke(self) -> str:
        """Return how the plant ended by itself with an error; empty if it did not."""
        plants = [child for child in self.children if child.name == PLANT]
        ended = not plants or plants[-1].status in (None, 0) or plants[-1].pid in self._signalled
        return "" if ended else plants[-1].report(f"after t = {self.t:g} s")

    def was_put_off(self) -> bool:
        return self.telemetry is not None and self.telemetry.pacing is not None and self.telemetry.pacing.slipped > 0.0

    def until_event(self, subject: str, text: str, after: int = 0) -> Town:
        return self.until(
            lambda: any(event.subject == subject and text in event.text for event in self.events[after:]),
            f"event {subject}: {text}",
        )

    def until_ended(self, name: str) -> int:
        child = self.children[name]
        self.until(lambda: child.status is not None, f"{name} ends")
        assert child.status is not None
        return child.status

    @property
    def t(self) -> float:
        return -1.0 if self.telemetry is None else self.telemetry.t

    def __str__(self) -> str:
        used = {name: (status.phase, status.used) for name, status in self.status.items()}
        return f"t = {self.t:g} s; {used}; events {[event.text for event in self.events]}; logs in {self.folder}"

    def _ended(self, child: Child) -> None:
        self.session.inbox.put(("word", child.name, b""))

    def _take(self, kind: str, key: str, payload: bytes) -> None:
        if kind == "appeared":
            self.tokens.add(key)
        elif kind == "vanished":
            self.tokens.discard(key)
        elif kind == "message":
            try:
                message = decode(payload)
            except RejectedError:
                return
            own = {AgentStatus: self.keys.status, State: self.keys.state}.get(type(message))
            if own is not None and key != own(message.sender):
                return
            if isinstance(message, Telemetry | LinkReport | LinkRequest) and key != self.keys.telemetry:
                return
            if isinstance(message, AgentStatus):
                self.status[message.sender] = message
            elif isinstance(message, State):
                self.states[message.sender] = message
            elif isinstance(message, Answer):
                self.answers.append(message)
            elif isinstance(message, LinkAcknowledgement):
                self.acknowledgements.append(message)
            elif isinstance(message, LinkRequest):
                self.orders.append(message)
            elif isinstance(message, LinkReport):
                self.link_record(message)
            elif isinstance(message, Telemetry):
                self.telemetry = message
                self.rows += message.rows
                self.events += message.events
