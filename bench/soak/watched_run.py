"""The run of a soak: its processes, the commands that it is given, and what is looked at while it is waited for.

They are `gridpeers up` with a record, and `gridpeers agent` for every agent that comes back.
"""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from time import monotonic, sleep
from types import TracebackType
from typing import NamedTuple, Self

import psutil

import gridpeers as gp
from bench.harness import GRIDPEERS
from bench.soak.judging import LAST_WORDS, ProcessSize
from bench.soak.soak_monitor import HOLD, SoakMonitor
from gridpeers.lab.communication.communication_checks import LastWords
from gridpeers.scenarios.checks.check_verdict import FILE as CHECKS
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, Violation, read_verdicts
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.live.run_address import RunAddress
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.watching import RunSubscriber
from gridpeers.scenarios.record.record_info import FILE as RECORD
from gridpeers.wire.messages import PLANT

BUILD = 300.0
"""Longest wait (s) for a run to begin: the plant may be compiled first."""

END = 20.0
"""Longest wait (s) for a process that was asked to end."""


class LiveProcesses:
    """The commands of one run, in a folder for their logs. Use it as a context: none is left.

    Each is in a session of its own: the Ctrl-C of a terminal reaches the bench alone, which ends them.
    """

    def __init__(self, folder: Path, run: str) -> None:
        endpoint = free_endpoint()
        self.folder = folder
        self.address = RunAddress(run=run, connect=(endpoint,))
        self.listen = ["--run", run, "--listen", endpoint]
        self.connect = ["--run", run, "--connect", endpoint]
        self._children: list[subprocess.Popen[bytes]] = []

    def start(self, name: str, *words: str) -> subprocess.Popen[bytes]:
        """Start a command by its words; what it prints is in `printed(name)`."""
        with self._log(name).open("wb") as log:
            child = subprocess.Popen(
                [*GRIDPEERS, *words], stdout=log, stderr=log, cwd=self.folder, start_new_session=True
            )
        self._children.append(child)
        return child

    def printed(self, name: str) -> str:
        """Return what the command of this name has printed so far."""
        return self._log(name).read_text(errors="replace")

    def _log(self, name: str) -> Path:
        return self.folder / f"{name}.log"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes that still run."""
        running = [child for child in self._children if child.poll() is None]
        for child in running:
            child.send_signal(signal.SIGCONT)  # a frozen one would not end
            child.send_signal(signal.SIGTERM)
        for child in running:
            try:
                child.wait(END)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


CALM = 6.0
"""Run time (s) at which both events of the scenario are over."""

PATIENCE = 30.0
"""Longest wait (s) for anything that an action brings about."""

CONCLUDE = 1800.0
"""Longest wait (s) for the report of the run after its end."""

LOOK = 5.0
"""Time (s) between two looks at the sizes of the processes."""


class SoakEnd(NamedTuple):
    """The end of the run."""

    status: int | None
    """Exit status of `gridpeers up`; None if it had not ended after `CONCLUDE`."""
    checks: tuple[CheckVerdict, ...]
    """Verdicts of the checks."""
    silences: tuple[Violation, ...]
    """All that the check of last words names."""
    report_s: float
    """How long its report took (s)."""
    peak_MB: float
    """Greatest memory of the command meanwhile (MB)."""
    files: Mapping[str, int]
    """Files of the run (bytes)."""


class CountingClient(RunClient):
    """A client that counts its sessions."""

    renewals = 0
    """How often it opened a new session."""

    def renew(self) -> None:
        """Open a new session."""
        self.renewals += 1
        super().renew()


def all_silences(folder: Path, verdicts: Sequence[CheckVerdict]) -> tuple[Violation, ...]:
    """Return all that the check of last words names: of many by a second pass over the record."""
    words = next((one for one in verdicts if one.check == LAST_WORDS), None)
    if words is None or words.count == len(words.violations):
        return () if words is None else words.violations
    (record,) = folder.rglob(RECORD)
    run = gp.read(record.parent.parent)
    assert isinstance(run, gp.Result), "a live run has one case"
    return tuple(LastWords()(run.checked_case))


class SoakError(RuntimeError):
    """The run does not go on; the message says what ended and its last lines."""


class WatchedRun:
    """A live run with a record, looked at whenever it is waited for. Use it as a context: no process is left.

    `microgrids` has the microgrid of each agent, and `spare` is the agent that is not there at first. Without a record
    there is no report and no verdict.
    """

    def __init__(
        self,
        folder: Path,
        microgrids: Mapping[str, str],
        spare: str,
        *,
        scenario: str = "islanding",
        recorded: bool = True,
    ) -> None:
        self.scenario = scenario
        self.microgrids, self.agents = microgrids, tuple(microgrids)
        self.monitor = SoakMonitor()
        self.monitor.off.add(spare)
        self.sizes: list[ProcessSize] = []
        self.problems: list[str] = []
        """What went wrong beside: a command that failed, a process that ended."""
        self._recorded = recorded
        self._processes = LiveProcesses(folder, f"soak{os.getpid()}")
        self._pids: dict[str, tuple[int, float]] = {}
        """Process and its start (s, monotonic) of the plant, the command and each agent."""
        self._started: dict[str, subprocess.Popen[bytes]] = {}
        """Agents that were started alone."""
        self._late = self._steps = self._logs = 0
        self._look = 0.0
        self._stack = ExitStack()

    @property
    def here(self) -> Path:
        """Folder of the run."""
        return self._processes.folder / "run"

    @property
    def steps(self) -> int:
        """Steps of the plant since the run is calm."""
        return 0 if self.monitor.pacing is None else self.monitor.pacing.steps - self._steps

    @property
    def late(self) -> int:
        """Those of them that were more than a control period late."""
        return 0 if self.monitor.pacing is None else self.monitor.pacing.late - self._late

    def __enter__(self) -> Self:
        """Start all processes; return once the run is calm."""
        try:
            self._stack.enter_context(self._processes)
            out = ["--out", str(self.here)] if self._recorded else []
            born = monotonic()
            self._up = self._processes.start("up", "up", self.scenario, *self._processes.listen, *out)
            self._client = CountingClient(self._processes.address, meet_agents=True)
            self._stack.callback(self._client.close)
            self._client.find_plant(BUILD)
            self._subscriber = RunSubscriber(self._client, self.monitor)
            self._need(self._until(lambda: self.monitor.t > CALM and self._calm(), BUILD), "the run is not calm")
            self._pids["command"] = self._up.pid, born
            for child in psutil.Process(self._up.pid).children():
                with suppress(OSError):  # its name is that of its log, as it may be forked; it may just have ended
                    name = Path(f"/proc/{child.pid}/fd/2").readlink().stem
                    if name in (PLANT, *self.agents):
                        self._pids[name] = child.pid, born
            missing = {PLANT, *self.agents} - self._pids.keys()
            self._need(not missing, f"no process of {', '.join(sorted(missing))} is found")
            if self.monitor.pacing is not None:
                self._late, self._steps = self.monitor.pacing.late, self.monitor.pacing.steps
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes that still run."""
        self._stack.close()

    def rest(self, seconds: float) -> None:
        """Let the run go on for some time (s)."""
        end = monotonic() + seconds
        self._until(lambda: monotonic() >= end, seconds + 1.0)

    # ---------------------------------------------------------------- processes

    def _command(self, *words: str) -> str:
        """Run a command to its end; return what it printed."""
        process = self._processes.start("command", *words, *self._processes.connect)
        if not self._until(lambda: process.poll() is not None, PATIENCE):
            process.kill()
            process.wait()
        text = self._processes.printed("command")
        if process.returncode:
            last = text.strip().splitlines()[-1:] or ["it printed nothing"]
            self.problems.append(
                f"t = {self.monitor.t:.1f} s: gridpeers {' '.join(words)} ended with {process.returncode}: {last[0]}"
            )
        return text

    def finish(self) -> SoakEnd:
        """End the run, and wait for its report."""
        self._look_at_sizes()  # an agent that came back may have come since the last look
        self._pids = {"command": self._pids["command"]}  # the others end now
        words = [*GRIDPEERS, "down", *self._processes.connect]
        down = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)
        if down.returncode:
            self.problems.append(f"gridpeers down ended with {down.returncode}: {down.stdout}{down.stderr}".strip())
        began, peak = monotonic(), 0.0
        while self._up.poll() is None and monotonic() < began + CONCLUDE:
            with suppress(psutil.Error):
                peak = max(peak, psutil.Process(self._up.pid).memory_info().rss / 1e6)
            sleep(0.05)
        took = monotonic() - began
        verdicts = [file for file in self.here.rglob(CHECKS)]
        checks = read_verdicts(verdicts[0])["IV"] if verdicts else ()
        return SoakEnd(
            status=self._up.poll(),
            checks=checks,
            silences=all_silences(self.here, checks),
            report_s=took,
            peak_MB=peak,
            files={file.name: file.stat().st_size for file in sorted(self.here.rglob("*")) if file.is_file()},
        )

    def _others(self, name: str) -> tuple[str, ...]:
        return tuple(other for other in self.agents if other != name)

    # ---------------------------------------------------------------- waiting and looking

    def _calm(self) -> bool:
        """Whether all agents use each other, and the frequency has been in its band for a while."""
        return self.monitor.use_each_other(self.agents, self.agents) and self.monitor.seconds_in_band >= HOLD

    def _until(self, condition: Callable[[], bool], patience: float) -> bool:
        """Take in messages until a condition holds; return whether it does."""
        end = monotonic() + patience
        while not condition():
            left = end - monotonic()
            if left <= 0.0:
                return False
            self._subscriber.take(min(left, 0.05))
            self._need(self._up.poll() is None, f"gridpeers up ended with status {self._up.returncode}")
            if monotonic() >= self._look and self._pids:
                self._look = monotonic() + LOOK
                self._look_at_sizes()
        return True

    def _look_at_sizes(self) -> None:
        at = monotonic()
        for name, (pid, born) in list(self._pids.items()):
            with suppress(psutil.Error):  # it has just ended
                process = psutil.Process(pid)
                memory = process.memory_info()
                anonymous = (memory.rss - memory.shared) / 1e6
                if memory.rss:  # else it has ended, and nobody has asked for its status yet
                    self.sizes.append(ProcessSize(at, name, pid, born, anonymous, process.num_fds()))

    def _need(self, sound: bool, why: str) -> None:
        if not sound:
            last = self._processes.printed("up").splitlines()[-8:]
            raise SoakError("\n".join((why, *last)))
