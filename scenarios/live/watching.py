"""A run on a terminal: once as text for `gridpeers status`, as a table that renews itself for `gridpeers watch`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import monotonic
from typing import Any, NamedTuple, Protocol

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.console import short, text_of
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.run_monitor import InverterStatus, RunMonitor, Snapshot
from gridpeers.scenarios.live.run_requests import plant_status, read_config
from gridpeers.wire.messages import MOST_INVERTERS, PLANT, AgentStatus, Telemetry
from gridpeers.wire.timing import SessionDeadline

EVENTS = 6

LOOK = 1.2  # Longest wait (s) for one snapshot: just over two periods of an agent's status
SILENT = 1.0  # Time (s) without a message after which a sender counts as silent: two periods of an agent's status
CONFIGS_AGAIN = 2.0  # Time (s) after which missing configurations are asked for again
REFRESH = 0.25  # Time (s) between two tables on a terminal: the plant publishes five times a second
PERIOD = 1.0  # Time (s) between two texts where the output is no terminal


class _Column(NamedTuple):
    head: str
    unit: str
    text: Callable[[InverterStatus], str]
    right: bool = True


def _number(value: float | None, digits: int = 0) -> str:
    return "-" if value is None else f"{round(value, digits) + 0.0:.{digits}f}"  # + 0.0: no -0.0


_COLUMNS = (
    _Column("agent", "", lambda one: one.name, right=False),
    _Column("island", "", lambda one: one.island or "-", right=False),
    _Column("f", "Hz", lambda one: _number(one.f, 3)),
    _Column("P", "kW", lambda one: _number(one.P, 1)),
    _Column("P_set", "kW", lambda one: _number(one.P_set, 1)),
    _Column("P", "pu", lambda one: _number(one.P_share, 3)),
    _Column("Q", "kvar", lambda one: _number(one.Q, 1)),
    _Column("V", "pu", lambda one: _number(one.V, 4)),
    _Column("V_set", "pu", lambda one: _number(one.V_set, 4)),
    _Column("hears", "", lambda one: short(list(one.ages)), right=False),
    _Column("age", "s", lambda one: _number(max(one.ages.values(), default=None), 2)),
    _Column("in", "", lambda one: _number(one.received)),
    _Column("out", "", lambda one: _number(one.sent)),
    _Column("lost", "", lambda one: _number(one.lost)),
    _Column("impaired", "", lambda one: short(one.impaired) if one.impaired else "", right=False),
    _Column("", "", lambda one: one.note, right=False),
)
"""Columns of each agent; "age" is that of the oldest state of the neighbours in use, "impaired" are the senders whose
links to it have an emulated fault."""


def _columns(snapshot: Snapshot) -> tuple[_Column, ...]:
    calm = not any(one.impaired for one in snapshot.inverters)
    return tuple(column for column in _COLUMNS if not (calm and column.head == "impaired"))


def head(snapshot: Snapshot) -> str:
    t = "has not begun" if snapshot.t is None else f"t = {snapshot.t:.2f} s"
    islands = list(dict.fromkeys(one.island for one in snapshot.inverters if one.island))
    parts = [f"run {snapshot.run}", t, snapshot.pace, f"islands: {', '.join(islands)}" if islands else ""]
    parts.append(f"impaired to the plant: {short(snapshot.impaired)}" if snapshot.impaired else "")
    return "   ".join(filter(None, parts))


def plain(snapshot: Snapshot) -> str:
    """Return the text for `gridpeers status`: no colour, no line drawing, columns that `awk` can cut."""
    return text_of(lambda console: console.print(table(snapshot, " ")))


def table(snapshot: Snapshot, before_unit: str = "\n") -> Group:
    grid = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    columns = _columns(snapshot)
    for column in columns:
        title = f"{column.head}{before_unit}{column.unit}".rstrip(" ")
        grid.add_column(title, justify="right" if column.right else "left", no_wrap=column.head != "hears")
    for one in snapshot.inverters:
        wrong = {
            "": one.note and not one.note.startswith("apart"),  # to be in another island is no fault
            "age": one.late,
            "lost": one.lost,
            "impaired": True,
        }
        wrong["agent"] = wrong[""]
        styles = ["yellow" if wrong.get(column.head) else "" for column in columns]
        grid.add_row(*(Text(column.text(one), style) for column, style in zip(columns, styles, strict=True)))
    events = [Text(line, style="dim", no_wrap=True, overflow="ellipsis") for line in snapshot.events[-EVENTS:]]
    return Group(Text(head(snapshot), style="bold"), *([grid] if snapshot.inverters else ()), *events)


class TakesMessages(Protocol):
    @property
    def inverters(self) -> tuple[str, ...]: ...
    def config(self, config: AgentConfig) -> None: ...
    def telemetry(self, message: Telemetry, now: float) -> None: ...
    def status(self, message: AgentStatus, now: float) -> None: ...


class RunSubscriber:
    """Feed the messages of a run into a monitor, under a lock if there is one; `on_other` takes all other messages."""

    def __init__(
        self,
        client: RunClient,
        monitor: TakesMessages,
        on_other: Callable[[str, bytes], None] = lambda key, payload: None,
        lock: AbstractContextManager[Any] | None = None,
    ) -> None:
        self._client, self._monitor, self._on_other, self._lock = client, monitor, on_other, lock or nullcontext()
        self._subscribed: set[str] = set()
        self._plant = client.plant
        self._heard_at: dict[str, float] = {}
        self._used: dict[str, tuple[str, ...]] = {}
        self._patience = SessionDeadline()
        self._configured: set[str] = set()
        self._ask_at = 0.0
        """When (s, monotonic) to ask for those that are missing: a question may be lost with its link."""
        client.listen(client.keys.telemetry)
        self._ask_for_configs(monotonic())

    def _ask_for_configs(self, now: float) -> None:
        if now >= self._ask_at:
            self._ask_at = now + CONFIGS_AGAIN
            self._client.fetch(self._client.keys.config("*"))

    def take(self, seconds: float) -> list[Telemetry | AgentStatus]:
        heard: list[Telemetry | AgentStatus] = []
        for key, payload, at in self._client.take(seconds):
            config = read_config(payload)
            message = None if config else self._client.read(key, payload)
            with self._lock:
                if config is not None:
                    self._monitor.config(config)
                    self._configured.add(config.name)
                elif isinstance(message, Telemetry):
                    self._monitor.telemetry(message, at)
                elif isinstance(message, AgentStatus):
                    self._monitor.status(message, at)
                    self._used[message.sender] = message.used
            if isinstance(message, Telemetry | AgentStatus):
                self._heard_at[message.sender] = at
                heard.append(message)
            elif config is None:
                self._on_other(key, payload)
        now = monotonic()
        if self._client.plant and not self._plant:  # it was restarted, perhaps with other inverters
            self._configured.clear()
            self._ask_at = now
        self._plant = self._client.plant
        with self._lock:
            inverters = self._monitor.inverters
        if self._plant and not self._configured.issuperset(inverters):
            self._ask_for_configs(now)
        for name in (*inverters, *self._client.present):
            if name not in self._subscribed and (name in inverters or len(self._subscribed) < MOST_INVERTERS):
                self._subscribed.add(name)  # of others there may be any number: anybody may hold their tokens
                self._client.listen(self._client.keys.status(name))
        self._renew(now)
        return heard

    def take_until(self, end: float) -> None:
        while (left := end - monotonic()) > 0.0:
            self.take(left)

    def _renew(self, now: float) -> None:
        """Open a new session if a process, whose token is there or that an agent uses, is silent for too long."""
        heard = {name for name, at in self._heard_at.items() if now - at <= SILENT}
        there = {*([PLANT] if self._client.plant else []), *self._client.present}
        there.update(*(self._used.get(name, ()) for name in heard))
        silent = dict.fromkeys(sorted(there - heard), 0.0)
        self._patience.whole |= PLANT in heard and not silent
        if self._patience.lost(silent, now):
            self._patience = self._patience.next()
            self._client.renew()


def _following(client: RunClient) -> tuple[RunMonitor, RunSubscriber]:
    monitor = RunMonitor(client.where.run)
    monitor.plant_status(plant_status(client))
    return monitor, RunSubscriber(client, monitor)


def look(client: RunClient) -> Snapshot:
    """Listen until the plant and every agent have published their state, or for `LOOK` seconds."""
    monitor, subscriber = _following(client)
    heard, end = set[str](), monotonic() + LOOK
    while (left := end - monotonic()) > 0.0:
        heard.update(message.sender for message in subscriber.take(left))
        if heard >= {PLANT, *client.present, *monitor.members} and monitor.has_configs:
            break
    return monitor.snapshot(client.present, monotonic())


def watch(client: RunClient, console: Console, seconds: float | None) -> None:
    monitor, subscriber = _following(client)
    end = float("inf") if seconds is None else monotonic() + seconds
    if not console.is_terminal:
        while monotonic() < end:
            subscriber.take_until(min(end, monotonic() + PERIOD))
            console.print(plain(monitor.snapshot(client.present, monotonic())), soft_wrap=True)
        return
    with Live(console=console, screen=True, auto_refresh=False) as live:
        while monotonic() < end:
            subscriber.take_until(monotonic() + REFRESH)
            shown = table(monitor.snapshot(client.present, monotonic()))
            live.update(Group(shown, Text("Ctrl-C: quit", style="dim")), refresh=True)
