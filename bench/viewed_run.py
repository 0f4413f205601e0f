"""A real run with a plant, agents, and the page in Chromium, for the benches of the view. Use it as a context."""

from __future__ import annotations

import re
import signal
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
import pytest

from bench.live_processes import BUILD, END, LiveProcesses
from bench.scale import write_scenario
from scenarios.live.client.run_client import RunClient
from scenarios.live.requests.run_requests import ask, plant_status
from scenarios.schema import load_scenario
from tests.processes.realtime.browsers import chromium
from wire.codec import decode
from wire.messages import LoadSetting, Measurement, Pacing

if TYPE_CHECKING:
    import subprocess
    from types import TracebackType

    from playwright.sync_api import Browser, Page

RUN = "viewed"

HOSTS = 8
"""Processes that share the agents of a larger run."""

OFFSETS = 20
"""Round trips to the page by which its clock is compared with ours."""


class View(NamedTuple):
    """A page that is open, and its server."""

    server: subprocess.Popen[bytes]
    page: Page


class ViewedRun:
    """A run in real time, without record; every process of it is ended with the context.

    Parameters
    ----------
    agents : int
        9 are the catalogue's islanding, a process each, control period 20 ms; more are joined copies of its feeder on a
        ring, in `HOSTS` processes, control period 100 ms.
    """

    def __init__(self, agents: int) -> None:
        self.agents = agents
        self.period = 0.02 if agents == 9 else 0.1
        """Control period (s)."""
        self._arrivals: list[tuple[float, float]] = []
        """Arrival (s, monotonic) and run time (s) of each measurement."""
        self._taken = 0
        self._stack = ExitStack()
        self._browser: Browser | None = None

    def __enter__(self) -> Self:
        """Start plant and agents; return once the run has gone on for some seconds."""
        signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended by SIGTERM"))  # so that the context ends, too
        try:
            folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="gridpeers-view-")))
            self._processes = self._stack.enter_context(LiveProcesses(folder, RUN))
            place = [*self._processes.listen, "--wait", "120"]
            if self.agents == 9:
                self._processes.start("run", "up", "islanding", *place)
            else:
                file = write_scenario(folder, self.agents, self.period, 3600.0, ["ring"], apart=False)
                names = [row.name for row in load_scenario(str(file))[1].inverters]
                self._processes.start("plant", "plant", str(file), *place)
                for k in range(HOSTS):
                    self._processes.start(f"host{k}", "agent", *names[k::HOSTS], *self._processes.connect)
            self.client = self._stack.enter_context(RunClient(self._processes.address))
            self.client.find_plant(BUILD)
            self.client.listen(self.client.keys.measurement("inv1"))
            self.listen_until(lambda: len(self._arrivals) * self.period > 6.0, BUILD)  # after both events
            self.take_delays()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the page, the browser and all processes."""
        self._stack.close()

    # ---------------------------------------------------------------- the page

    @property
    def browser(self) -> Browser:
        """Chromium, started when it is first needed."""
        if self._browser is None:
            try:
                self._browser = self._stack.enter_context(chromium())
            except pytest.skip.Exception as missing:
                sys.exit(str(missing))
        return self._browser

    def open_view(self) -> View:
        """Start a view and open its page; return once it shows numbers of now."""
        server, end = self._processes.start("view", "view", "--port", "0", *self._processes.connect), monotonic() + 60.0
        while not (found := re.search(r"open (http://\S+) in a browser", self._processes.printed("view"))):
            if server.poll() is not None or monotonic() > end:
                raise RuntimeError(f"the view has not begun: {self._processes.printed('view')}")
            self.listen(0.1)
        page = self.browser.new_page(viewport={"width": 1500, "height": 1000})
        page.goto(found[1])
        page.wait_for_selector('body[data-live="live"]', timeout=60_000)
        return View(server, page)

    def close_view(self, view: View) -> None:
        """Close the page, and end its server."""
        view.page.close()
        view.server.send_signal(signal.SIGTERM)
        view.server.wait(END)

    # ---------------------------------------------------------------- the run

    def set_load(self, name: str, factor: float) -> None:
        """Set a load, as `gridpeers load` does."""
        ask(self.client, "load", name, LoadSetting(factor=factor))

    def pacing(self) -> Pacing:
        """Return the plant's own account of its steps."""
        return plant_status(self.client).pacing

    def listen(self, seconds: float) -> None:
        """Take measurements in for some time (s)."""
        end = monotonic() + seconds
        self.listen_until(lambda: monotonic() >= end, seconds + 1.0)

    def listen_until(self, done: Any, longest: float) -> None:
        """Take measurements in until a condition holds; RuntimeError after the longest time (s)."""
        end = monotonic() + longest
        while not done():
            if monotonic() > end:
                logs = "\n".join(path.read_text()[-500:] for path in self._processes.folder.glob("*.log"))
                raise RuntimeError(f"the run has not come so far within {longest:g} s:\n{logs}")
            for key, payload, at in self.client.take(0.05):
                if key == self.client.keys.measurement("inv1"):
                    message = decode(payload)
                    assert isinstance(message, Measurement)
                    self._arrivals.append((at, message.t))

    def take_delays(self) -> list[float]:
        """Take out how late (s) the measurements since the last call came, beside the soonest one ever."""
        delays = [at - t - self.epoch for at, t in self._arrivals[self._taken :]]
        self._taken = len(self._arrivals)
        return delays

    @property
    def epoch(self) -> float:
        """Time (s, monotonic) of t = 0 by the plant's schedule: that of the measurement that came soonest."""
        return min(at - t for at, t in self._arrivals)


def clock_of(page: Page) -> float:
    """Return what is to be added to the page's `performance.now()` (s) for our monotonic clock."""
    trips = []
    for _ in range(OFFSETS):
        before = monotonic()
        there = float(page.evaluate("() => performance.now()")) / 1e3
        after = monotonic()
        trips.append((after - before, 0.5 * (before + after) - there))
    return min(trips)[1]


def in_ms(values: list[float]) -> str:
    """Return median, 95th and 99th percentile and the greatest of some times (s), in ms.

    Examples
    --------
    >>> in_ms([0.010, 0.012, 0.020])
    'p50 12.0 ms, p95 19.2 ms, p99 19.8 ms, max 20.0 ms (3)'
    """
    p50, p95, p99, most = (1e3 * float(np.percentile(values, q)) for q in (50, 95, 99, 100))
    return f"p50 {p50:.1f} ms, p95 {p95:.1f} ms, p99 {p99:.1f} ms, max {most:.1f} ms ({len(values)})"
