"""The disturbances of docs/reliability.md, each on a run of nine agents on the paper's feeder in real time."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic, sleep, time
from unittest.mock import patch

from tests.resources.trial import Trial, Watch, attacked, real_town
from tests.toy.town import Town

SETTLED = 6.0
"""Run time (s) at which the islanded feeder has restored its frequency."""

READER = """
import os, signal, sys
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import Keys
session = Session("reader", listen=("tcp/127.0.0.1:0",), connect=(sys.argv[1],), clock="wall")
keys = Keys(sys.argv[2])
for name in sys.argv[3:]:
    session.subscribe(keys.state(name))
    session.subscribe(keys.status(name))
session.subscribe(keys.telemetry)
while session.peers() < len(sys.argv) - 2:
    session.take(1, 0.05)
print("linked", flush=True)
session.take(10**9, 1.0)
os.kill(os.getpid(), signal.SIGSTOP)
"""


@contextmanager
def settled() -> Iterator[Town]:
    """Start the run, and wait until it has restored its frequency; its processes and its folder end with it."""
    with tempfile.TemporaryDirectory(prefix="trial") as folder, real_town(Path(folder)) as town:
        yield town.all().until(lambda: town.t >= SETTLED, "the frequency is restored", patience=60.0)


def flood(
    kind: str, rate: float = 0.0, seconds: float = 10.0, *, size: int = 0, tokens: int = 0
) -> Callable[[], tuple[Trial, str]]:
    """Return a trial with an attacker."""

    def trial() -> tuple[Trial, str]:
        with settled() as town:
            result, sent = attacked(town, kind, rate, seconds, size=size, tokens=tokens)
            return result, f"{sent} sent"

    return trial


def slow_reader() -> tuple[Trial, str]:
    """Freeze a process that has subscribed to all that plant and agents say."""
    with settled() as town:
        watch = Watch(town)
        words = [sys.executable, "-c", READER, town.endpoint, town.plant_config.run, *town.plant_config.agents]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            assert process.stdout.readline().strip() == "linked"
            begin = len(town.rows)
            watch.run_on(12.0)
            rows = town.rows[begin:]
        finally:
            process.kill()
            process.communicate()
        watch.run_on(1.0)
        town.together(town.plant_config.agents)
        return watch.result(rows), "frozen for 11 s"


def busy() -> tuple[Trial, str]:
    """Compute on all cores, with four times as many processes."""
    with settled() as town:
        watch, begin = Watch(town), len(town.rows)
        spinning = [
            subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4 * (os.cpu_count() or 1))
        ]
        try:
            end = monotonic() + 5.0
            town.until(lambda: monotonic() >= end, "5 s", patience=60.0)
        finally:
            for process in spinning:
                process.kill()
                process.wait()
        rows = town.rows[begin:]
        watch.run_on(2.0)
        town.together(town.plant_config.agents)
        return watch.result(rows), f"{len(spinning)} processes for 5 s"


def frozen_plant() -> tuple[Trial, str]:
    """Freeze the plant for 5 s."""
    with settled() as town:
        watch, begin = Watch(town), len(town.rows)
        town.signal("plant", signal.SIGSTOP)
        sleep(5.0)
        town.signal("plant", signal.SIGCONT)
        town.until(town.was_put_off, "the plant says by how much", patience=60.0)
        town.together(town.plant_config.agents)
        rows = town.rows[begin:]
        watch.run_on(2.0)
        return watch.result(rows), "5 s"


def jumping_clock() -> tuple[Trial, str]:
    """Let the clock of the day of plant and agents jump by two hours every two seconds, below Python and Zenoh."""
    if shutil.which("cc") is None:
        raise SkippedError("there is no C compiler for the library that makes the clock jump")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "jumping_clock.so"
        source = Path(__file__).with_name("jumping_clock.c")
        subprocess.run(["cc", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
        with ExitStack() as stack:
            with patch.dict(os.environ, LD_PRELOAD=str(library)):
                town = stack.enter_context(settled())
            watch, begin = Watch(town), len(town.rows)
            watch.run_on(10.0)
            result = watch.result(town.rows[begin:])
            ahead = {_hours_ahead(library) for _ in range(30)}
            assert ahead == {-1, 1}, ahead
            return result, "by two hours every 2 s"


def _hours_ahead(library: Path) -> int:
    """Return by how many hours the clock of the day of a process with a library is ahead of this one's."""
    words, env = [sys.executable, "-c", "import time; print(time.time())"], {**os.environ, "LD_PRELOAD": str(library)}
    told = float(subprocess.run(words, env=env, capture_output=True, text=True, check=True).stdout)
    sleep(0.1)
    return round((told - time()) / 3600.0)


class SkippedError(Exception):
    """A trial cannot be made here; the message says why."""


TRIALS: dict[str, Callable[[], tuple[Trial, str]]] = {
    "nothing (for comparison)": lambda: _calm(10.0),
    "foreign messages, 10,000 a second": flood("foreign", 10_000.0),
    "copies of old messages, 10,000 a second": flood("copied", 10_000.0),
    "foreign messages, as fast as it goes": flood("foreign", 0.0),
    "questions, 2,000 a second, each of another client": flood("commands", 2_000.0),
    "5,000 processes that claim a name": flood("tokens", tokens=5_000),
    "messages of 100 MB": flood("long", 2.0, size=100_000_000),
    "messages of 200 kB, as fast as it goes": flood("long", 0.0, size=200_000),
    "a reader that is frozen": slow_reader,
    "all cores busy": busy,
    "the plant frozen": frozen_plant,
    "a clock that jumps": jumping_clock,
}


def _calm(seconds: float) -> tuple[Trial, str]:
    with settled() as town:
        watch, begin = Watch(town), len(town.rows)
        watch.run_on(seconds)
        return watch.result(town.rows[begin:]), ""
