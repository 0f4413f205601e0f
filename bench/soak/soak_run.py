"""The actions of a soak on its run: commands of a user, or signals to a process, and how long all takes."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from bench.soak.soak_actions import SETTLE, SoakAction
from bench.soak.watched_run import PATIENCE, WatchedRun

LOAD, ZONE = "48", "60-160"
"""The load that is set, and the switch of the zone that the scenario drops."""


class Timed(NamedTuple):
    """A time that was measured."""

    what: str
    """heal, told, joined or restored."""
    seconds: float
    """The time (s); infinite if it did not come true within `PATIENCE`."""
    of: SoakAction
    t: float
    """Run time (s)."""
    deaf: bool
    """Whether this program opened a new session meanwhile, so that the time may be its own."""


class SoakRun(WatchedRun):
    """A live run that is disturbed; its parameters are those of `WatchedRun`."""

    def __init__(
        self,
        folder: Path,
        microgrids: Mapping[str, str],
        spare: str,
        *,
        scenario: str = "islanding",
        recorded: bool = True,
    ) -> None:
        super().__init__(folder, microgrids, spare, scenario=scenario, recorded=recorded)
        self.times: list[Timed] = []
        self.kills: list[tuple[str, float]] = []
        """Agents that were killed, and when (s of run time)."""

    def disturb(self, one: SoakAction) -> None:
        """Do one action, and wait until all is as before."""
        self.monitor.restorations.clear()
        deaf = self._client.renewals
        if one.kind in ("load", "zone"):
            self.rest(SETTLE)
        getattr(self, f"_{one.kind}")(one)
        if not self._until(self._calm, PATIENCE):
            self._note("restored", float("inf"), one, deaf)
        for seconds in self.monitor.restorations:
            self._note("restored", seconds, one, deaf)
        self.rest(one.rest)

    def _leave(self, one: SoakAction) -> None:
        (name,) = one.agents
        self._stop(name)
        self.rest(one.seconds)
        self._join(name, one)

    def _spare(self, one: SoakAction) -> None:
        (name,) = one.agents
        self._join(name, one)
        self.rest(one.seconds)
        self._stop(name)

    def _kill(self, one: SoakAction) -> None:
        (name,) = one.agents
        others, began, deaf = self._others(name), monotonic(), self._client.renewals
        self.kills.append((name, self.monitor.t))
        os.kill(self._pids[name][0], signal.SIGKILL)
        self._gone(name)
        self._wait(
            "told",
            lambda: self.monitor.told(name, "died", began) and self.monitor.none_uses(name, others),
            began,
            one,
            deaf,
        )
        self.rest(one.seconds)
        self._join(name, one)

    def _freeze(self, one: SoakAction) -> None:
        (name,) = one.agents
        pid, deaf = self._pids[name][0], self._client.renewals
        os.kill(pid, signal.SIGSTOP)
        try:
            self.rest(one.seconds)
        finally:
            os.kill(pid, signal.SIGCONT)
        woken = monotonic()
        others = self._others(name)
        self._wait("heal", lambda: self.monitor.use_each_other((name,), others, woken), woken, one, deaf)

    def _cut(self, one: SoakAction) -> None:
        self._cut_between(one, one.agents, (one.agents[0],), (one.agents[1],))

    def _isolate(self, one: SoakAction) -> None:
        (name,) = one.agents
        self._cut_between(one, (f"{name} <-> *",), (name,), self._others(name))

    def _part(self, one: SoakAction) -> None:
        first, second = (tuple(name for name in self.agents if self.microgrids[name] == group) for group in one.agents)
        self._cut_between(one, (f"{one.agents[0]} <-> {one.agents[1]}",), first, second)

    def _cut_between(
        self, one: SoakAction, links: tuple[str, ...], some: tuple[str, ...], others: tuple[str, ...]
    ) -> None:
        """Cut links, heal them, and measure how long both sides take to use each other's new values."""
        deaf = self._client.renewals
        if one.ends_itself:
            begin = self._from(self._command("link", "cut", *links, "--for", f"{one.seconds:g}"))
            healed = self.monitor.real_time(begin + one.seconds)
            self.rest(max(0.0, healed - monotonic()))
        else:
            self._command("link", "cut", *links)
            self.rest(one.seconds)
            healed = self.monitor.real_time(self._from(self._command("link", "heal", *links)))
        self._wait("heal", lambda: self.monitor.use_each_other(some, others, healed), healed, one, deaf)

    def _impair(self, one: SoakAction) -> None:
        options = ["--delay", f"{one.delay:g}", "--loss", f"{one.loss:g}", "--for", f"{one.seconds:g}"]
        self._command("link", "set", *one.agents, *options)
        self.rest(one.seconds)

    def _load(self, one: SoakAction) -> None:
        self._command("load", LOAD, "--factor", f"{one.factor:g}")
        self.rest(one.seconds)
        self._command("load", LOAD, "--factor", "1")

    def _zone(self, one: SoakAction) -> None:
        self._command("event", "close", ZONE)
        self.rest(one.seconds)
        self._command("event", "open", ZONE)

    # ---------------------------------------------------------------- agents that come and go

    def _join(self, name: str, one: SoakAction) -> None:
        """Start an agent, and measure how long it takes until it and the others use each other."""
        began, deaf = monotonic(), self._client.renewals
        self._logs += 1
        agent = self._processes.start(f"{name}-{self._logs}", "agent", name, *self._processes.connect)
        self._started[name], self._pids[name] = agent, (agent.pid, began)
        others = self._others(name)
        self._wait("joined", lambda: self.monitor.use_each_other((name,), others, began), began, one, deaf)
        self.monitor.off.discard(name)

    def _stop(self, name: str) -> None:
        """Have an agent leave."""
        self.monitor.off.add(name)
        self._command("stop", name)
        self._gone(name)

    def _gone(self, name: str) -> None:
        """Wait for the end of an agent's process."""
        pid, _ = self._pids.pop(name)
        process = self._started.pop(name, None)
        ended = self._until(
            lambda: not Path(f"/proc/{pid}").exists() if process is None else process.poll() is not None, PATIENCE
        )
        if not ended:
            self.problems.append(f"t = {self.monitor.t:.1f} s: the process of {name} has not ended")

    # ---------------------------------------------------------------- measured times

    def _from(self, text: str) -> float:
        """Return the run time (s) from which on a link command holds, as it printed."""
        found = re.search(r"from t = ([\d.]+) s on", text)
        return float(found[1]) if found else self.monitor.t

    def _wait(self, what: str, condition: Callable[[], bool], since: float, one: SoakAction, deaf: int) -> None:
        """Wait until a condition holds, and note how long that took since a time (s, monotonic)."""
        came = self._until(condition, PATIENCE)
        self._note(what, max(0.0, monotonic() - since) if came else float("inf"), one, deaf)

    def _note(self, what: str, seconds: float, one: SoakAction, deaf: int) -> None:
        self.times.append(Timed(what, seconds, one, self.monitor.t, self._client.renewals > deaf))
