"""Look at a run: once for `gridpeers status`, and as a table that renews itself for `gridpeers watch`."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Protocol

from rich.console import Console
from rich.live import Live

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.live.client.run_client import RunClient
from gridpeers.scenarios.live.requests.agent_configs import read_config
from gridpeers.scenarios.live.requests.run_requests import plant_status
from gridpeers.scenarios.live.show.render import plain, table
from gridpeers.scenarios.live.show.run_monitor import RunMonitor
from gridpeers.scenarios.live.show.snapshot import Snapshot
from gridpeers.wire.bounds import MOST_INVERTERS
from gridpeers.wire.messages import PLANT, AgentStatus, Telemetry
from gridpeers.wire.timing.session_deadline import SessionDeadline

LOOK = 1.2
"""Longest wait (s) for one snapshot: two periods of an agent's status, and a bit."""

SILENT = 1.0
"""Time (s) without a message after which a sender counts as silent: two periods of an agent's status."""

CONFIGS_AGAIN = 2.0
"""Time (s) after which missing configurations are asked for again."""

REFRESH = 0.25
"""Time (s) between two tables on a terminal: the plant publishes five times a second."""

PERIOD = 1.0
"""Time (s) between two texts where the output is no terminal."""

QUIT = ("q", "Q", "\x1b")
"""Keys that end it."""


class TakesMessages(Protocol):
    """The part of a `RunMonitor` that takes messages; the page's view has it too."""

    @property
    def inverters(self) -> tuple[str, ...]:
        """Names of all inverters in the messages so far."""
        ...

    def config(self, config: AgentConfig) -> None:
        """Take the configuration of an agent."""
        ...

    def telemetry(self, message: Telemetry, now: float) -> None:
        """Take the plant's telemetry."""
        ...

    def status(self, message: AgentStatus, now: float) -> None:
        """Take the status of an agent."""
        ...


def leave_out(key: str, payload: bytes) -> None:
    """Leave out what is neither telemetry nor the status or configuration of an agent."""


class RunSubscriber:
    """Feed the messages of a run into a monitor.

    Parameters
    ----------
    client : RunClient
        At the run.
    monitor : TakesMessages
        Takes the messages.
    on_other : Callable[[str, bytes], None], optional
        Called with key and payload of every other message.
    """

    def __init__(
        self, client: RunClient, monitor: TakesMessages, on_other: Callable[[str, bytes], None] = leave_out
    ) -> None:
        self._client, self._monitor, self._on_other = client, monitor, on_other
        self._subscribed: set[str] = set()
        self._plant = client.plant
        self._heard_at: dict[str, float] = {}
        """Time at which each sender was last heard."""
        self._used: dict[str, tuple[str, ...]] = {}
        """Neighbours that each agent uses."""
        self._patience = SessionDeadline()
        self._configured: set[str] = set()
        """Inverters whose configuration has come."""
        self._ask_at = 0.0
        """When (s, monotonic) to ask for those that are missing."""
        client.listen(client.keys.telemetry)
        self._ask_for_configs(monotonic())

    def _ask_for_configs(self, now: float) -> None:
        """Ask for the configurations of all agents; a question may be lost with its link."""
        if now >= self._ask_at:
            self._ask_at = now + CONFIGS_AGAIN
            self._client.fetch(self._client.keys.config("*"))

    def take(self, seconds: float) -> list[Telemetry | AgentStatus]:
        """Wait (s) for messages, feed them into the monitor and return them."""
        heard: list[Telemetry | AgentStatus] = []
        for key, payload, at in self._client.take(seconds):
            config = read_config(payload)
            if config is not None:
                self._monitor.config(config)
                self._configured.add(config.name)
                continue
            message = self._client.read(key, payload)
            if isinstance(message, Telemetry):
                self._monitor.telemetry(message, at)
            elif isinstance(message, AgentStatus):
                self._monitor.status(message, at)
                self._used[message.sender] = message.used
            else:
                self._on_other(key, payload)
                continue
            self._heard_at[message.sender] = at
            heard.append(message)
        now = monotonic()
        if self._client.plant and not self._plant:  # it was restarted, perhaps with other inverters
            self._configured.clear()
            self._ask_at = now
        self._plant = self._client.plant
        if self._plant and not self._configured.issuperset(self._monitor.inverters):
            self._ask_for_configs(now)
        for name in self._monitor.inverters:
            self._listen_to(name)
        for name in self._client.present:  # anybody may hold tokens of any names
            if len(self._subscribed) < MOST_INVERTERS:
                self._listen_to(name)
        self._renew(now)
        return heard

    def _listen_to(self, name: str) -> None:
        if name not in self._subscribed:
            self._subscribed.add(name)
            self._client.listen(self._client.keys.status(name))

    def take_until(self, end: float) -> None:
        """Feed the messages that come until a time (s, monotonic)."""
        while (left := end - monotonic()) > 0.0:
            self.take(left)

    def _renew(self, now: float) -> None:
        """Open a new session if a process that takes part has been silent for too long, or this host has moved.

        A process takes part if its token is there, or if an agent that is heard uses it.
        """
        heard = {name for name, at in self._heard_at.items() if now - at <= SILENT}
        there = {*([PLANT] if self._client.plant else []), *self._client.present}
        there.update(*(self._used.get(name, ()) for name in heard))
        silent = dict.fromkeys(sorted(there - heard), 0.0)
        self._patience.whole |= PLANT in heard and not silent
        if self._patience.lost(silent, now) or self._client.moved:
            self._patience = self._patience.next()
            self._client.renew()


def look(client: RunClient) -> Snapshot:
    """Listen until the plant and every agent have published their state, or for `LOOK` seconds."""
    monitor = RunMonitor(client.where.run)
    monitor.plant_status(plant_status(client))
    subscriber, heard = RunSubscriber(client, monitor), set[str]()
    end = monotonic() + LOOK
    while (left := end - monotonic()) > 0.0:
        heard.update(message.sender for message in subscriber.take(left))
        if heard >= {PLANT, *client.present, *monitor.members} and monitor.has_configs:
            break
    return monitor.snapshot(client.present, monotonic())


def watch(client: RunClient, console: Console, seconds: float | None) -> None:
    """Show a run until the user quits, or for a time.

    Parameters
    ----------
    client : RunClient
        At the run, with its agents met.
    console : Console
        The terminal.
    seconds : float or None
        Time (s) after which it ends; None until q or Ctrl-C.
    """
    monitor = RunMonitor(client.where.run)
    monitor.plant_status(plant_status(client))
    subscriber = RunSubscriber(client, monitor)
    end = float("inf") if seconds is None else monotonic() + seconds
    if not console.is_terminal:
        while monotonic() < end:
            subscriber.take_until(min(end, monotonic() + PERIOD))
            text = plain(monitor.snapshot(client.present, monotonic()))
            console.print(text, soft_wrap=True)
        return
    with keyboard() as key, Live(console=console, screen=True, auto_refresh=False) as live:
        while monotonic() < end:
            subscriber.take_until(monotonic() + REFRESH)
            live.update(table(monitor.snapshot(client.present, monotonic())), refresh=True)
            if key(0.0) in QUIT:
                return


@contextmanager
def keyboard() -> Iterator[Callable[[float], str]]:
    """Yield a function that waits (s) for a key typed without Enter; "" if none came. Ctrl-C stays Ctrl-C.

    Where standard input is no terminal, or the system has no termios, it returns "" at once.
    """
    try:
        import termios
        import tty
    except ImportError:
        yield lambda seconds: ""
        return
    try:
        file = sys.stdin.fileno()
        before = termios.tcgetattr(file)
    except (OSError, ValueError, termios.error):
        yield lambda seconds: ""
        return

    def read(seconds: float) -> str:
        ready, _, _ = select.select([file], [], [], seconds)
        return os.read(file, 1).decode(errors="replace") if ready else ""

    tty.setcbreak(file)
    try:
        yield read
    finally:
        termios.tcsetattr(file, termios.TCSADRAIN, before)
