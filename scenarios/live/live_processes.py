"""Run a plant, an agent, or both together, from the terminal where they were started; say and record what happens."""

from __future__ import annotations

import dataclasses
import logging
import re
import sys
import threading
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from time import monotonic

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_process import run_agents
from gridpeers.plant.known_names import COMPILING, READY
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_process import run_plant
from gridpeers.plant.realtime.pacer import sentence
from gridpeers.scenarios.console import short, terminal
from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.drivers.forking import release
from gridpeers.scenarios.drivers.supervisor import Supervisor
from gridpeers.scenarios.drivers.telemetry_client import RECORDER, TelemetryClient, with_recorder
from gridpeers.scenarios.drivers.telemetry_stream import Recordable
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.live.run_address import RunAddress, UsageError, far_hosts, loopback_of, return_path
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.run_monitor import line_of, repeated
from gridpeers.scenarios.live.run_requests import ANSWER, free_configurations, own_code
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.results.record import Recorded, Recorder, RecordError
from gridpeers.scenarios.results.run_files import set_broken, set_complete, shown
from gridpeers.scenarios.run_request import Request
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.ending import stop_at_signals
from gridpeers.wire.driver.machine import keep_out_of_the_heap
from gridpeers.wire.messages import PLANT, Pacing, PlantEvent, Telemetry
from gridpeers.wire.timing import RateLimit
from gridpeers.wire.wording import printable

LOGGED = ("roster", "warning")  # Kinds of events that a plant in this process also writes to its log
CHECK = 0.25  # Time (s) between two checks for process faults that are due

UNHEARD = "the plant has ended, and this command never had a link to it"

LEAVING = 5.0  # Time (s) for processes to close by themselves after the plant

GOES_ON = "; the run continues without it"

_STOP = "stop"


def say(line: str) -> None:
    print(line, flush=True)


def _say_all(lines: Iterable[str]) -> None:
    for line in lines:
        say(line)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ProcessOutcome:
    broke: str = ""
    interrupted: str = ""
    """Name of the signal that ended it: SIGINT, as Ctrl-C gives, or SIGTERM."""
    recorded: Recorded | None = None
    pacing: Pacing | None = None
    failed_laws: tuple[PlantEvent, ...] = ()


class LiveRecorder:
    """Say the plant's events, but for `silent` kinds, and record the run, in a thread, while its context lasts.

    The plant waits for it before the start and at the end. Without a folder there is no record.
    """

    def __init__(
        self, config: PlantConfig, folder: Path | None, record: RecordInfo, *, silent: Collection[str] = ()
    ) -> None:
        self._config, self._silent = config, silent
        self._recorder = None if folder is None else Recorder(folder, gaps=True, record=record)
        self.recorded: Recorded | None = None
        self.failure = ""
        self.failed_laws: dict[str, PlantEvent] = {}
        self._limit = RateLimit()
        self.client: TelemetryClient
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def __enter__(self) -> LiveRecorder:
        keep_out_of_the_heap()
        config, endpoint = self._config, loopback_of(self._config.listen[0])
        self.client = TelemetryClient(RECORDER, config.run, endpoint, "realtime", self._take, config.credentials)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.client.say(_STOP)
        self._thread.join()
        self.client.close()
        _say_all((*self._limit.left_out(), *self.client.rejects.take_lines()))
        if (recorder := self._recorder) is not None:
            self._tried("the record cannot be written", lambda: self._finish(recorder))
            recorder.close()

    def note_crash(self, agent: str, end: str) -> None:
        """Note that the process of an agent crashed; `end` describes the crash. Any thread may call it."""
        self.client.say(f"{agent} {end}")

    def _tried(self, what: str, act: Callable[[], None], consequence: str = "") -> bool:
        try:
            act()
        except (RecordError, OSError) as error:
            text = f"{what}: {getattr(error, 'strerror', None) or error}"
            say(text + consequence)
            self.failure = self.failure or text
            return False
        return True

    def _finish(self, recorder: Recorder) -> None:
        """Write the tables; an incomplete record has none."""
        if recorder.count < 2:
            say("nothing was recorded, so nothing is measured")
        elif not self.client.ended:
            say(text := f"the record ends at {recorder.case.ended:.2f} s, without the plant's last message")
            self.failure = self.failure or text
        else:
            self.recorded = recorder.finish()
            _say_all(self.recorded.links.lines())

    def _follow(self) -> None:
        while not self.client.ended:
            for word in self.client.take(None):
                if word == _STOP:
                    return
                self.client.note_crash(*word.split(" ", 1))
        self.client.close()  # with it goes the token: the plant knows that the last telemetry is here

    def _take(self, message: Recordable) -> None:
        """Say and record one message; an error in it must not end the recording of the others."""
        try:
            recorder = self._recorder
            if isinstance(message, Telemetry):
                self._say_events(message)
            if recorder is None:
                return
            known = len(recorder.case.missing)
            if not self._tried(f"the record ends at {recorder.case.ended:.2f} s", lambda: recorder(message), GOES_ON):
                self._recorder = None
                recorder.close()
            for before, after in recorder.case.missing[known:]:
                say(f"rows between {before:.2f} and {after:.2f} s are missing: the plant was not heard")
        except Exception as error:
            self.client.rejects.failed("telemetry", error)

    def _say_events(self, telemetry: Telemetry) -> None:
        for event in telemetry.events:
            if event.kind == "law":
                self.failed_laws.setdefault(event.subject, event)
            if event.kind in self._silent or repeated(event):
                continue
            if (line := self._limit.admit(line_of(event), monotonic())) is not None:
                say(line)
        if telemetry.final:  # before the terminal says that the run has ended
            _say_all(self._limit.left_out())


def meaning(word: str, config: PlantConfig) -> str:
    """Return a sentence for a line of the plant's start or of a refused link, or an empty string."""
    if word == COMPILING:
        return "the plant is being built; the first time, its inner loop is compiled, which takes some seconds"
    if word == READY:
        agents = f"{len(config.agents)} agents {short(config.agents)}"
        wait = config.wait_for_agents
        return f"waits up to {wait:g} s for its {agents}" if wait > 0.0 else f"does not wait for its {agents}"
    refused = re.search(r"WARN.*zenoh_link_tls\S*\s(.*?)(?:\. Hint:.*)?$", word)
    return f"a link was refused: {printable(refused[1])}" if refused else ""


def plant_here(config: PlantConfig, folder: Path | None, record: RecordInfo) -> ProcessOutcome:
    stop_at_signals(StoppedError)
    _log()
    config = with_recorder(config, waits=folder is not None)

    def on_word(word: str) -> None:
        if word == COMPILING:  # the plant's log reports the rest
            say(meaning(word, config))

    recorder = LiveRecorder(config, folder, record, silent=LOGGED)
    outcome = _followed(recorder, lambda: run_plant(config, make_links=links_of, on_word=on_word))
    if outcome.interrupted:  # else the plant has said it
        _say_end(recorder, config)
    return outcome


def all_here(
    config: PlantConfig, agents: tuple[AgentConfig, ...], logs: Path, folder: Path | None, record: RecordInfo
) -> ProcessOutcome:
    """Run the plant and its agents, without spare ones, each in a process, until the run ends."""
    stop_at_signals(StoppedError)
    config = with_recorder(config, waits=folder is not None)
    endpoint, listen = loopback_of(config.listen[0]), return_path(config.listen)
    over = threading.Event()

    def on_exit(child: Child) -> None:
        if child.name == PLANT:
            over.set()
        elif supervisor.failed(child) and not over.is_set():
            say(child.report(f"after t = {recorder.client.t:.2f} s"))
            if child.crashed:
                recorder.note_crash(child.name, child.end)

    limit = RateLimit()

    def on_word(word: str) -> None:
        text = meaning(word, config)  # a peer without access tries for ever, and each time the plant says a line
        if text and (line := limit.admit(text, monotonic())):
            say(line)

    def run() -> str:
        with supervisor:
            supervisor.start(PLANT, *(agent.name for agent in agents if agent.name in config.agents))
            release()
            try:
                while not over.wait(min(supervisor.faults.wait, CHECK)):
                    if recorder.client.progress is not None:
                        supervisor.faults.note_time(*recorder.client.progress)
                    supervisor.work()
                supervisor.children.wait(LEAVING)
            finally:
                over.set()  # what is killed from here on, is so because it did not end in time
                supervisor.faults.end(supervisor.children)
        plant = supervisor.children[PLANT]
        return "" if plant.status == 0 else plant.report(f"after t = {recorder.client.t:.2f} s")

    configs = [replace(agent, connect=(endpoint,), listen=listen) for agent in agents]
    supervisor = Supervisor(config, configs, logs, on_exit, on_word)
    recorder = LiveRecorder(config, folder, record)
    outcome = _followed(recorder, run)
    _say_end(recorder, config)
    return outcome


def agent_here(
    where: RunAddress, names: tuple[str, ...], listen: tuple[str, ...] | None, wait: float, *, trusts: bool = False
) -> ProcessOutcome:
    """Run agents in this process, in one session, with the configurations that the plant hands out, until they leave.

    `listen` is where other agents connect; None takes any free port, of all addresses if others can reach the plant.
    UsageError if a plant on another host names code that does not come with gridpeers, and is not trusted; NobodyError
    if within `wait` (s) there is no plant, no such inverter, or another agent of it.
    """
    stop_at_signals(StoppedError)
    _log()
    who = ", ".join(names)
    say(f"{who}: looks for the plant of {where}, for up to {wait:g} s")
    try:
        with RunClient(where) as client:
            end = monotonic() + wait
            client.find_plant(wait, lambda line: say(f"{who}: {line}"))
            configs = free_configurations(client, names, max(ANSWER, end - monotonic()))
        named = list(dict.fromkeys(code for config in configs for code in own_code(config)))
        if named and not trusts and far_hosts(where.connect):
            raise UsageError(
                f"{who}: the plant of {where} names {' and '.join(named)}, code that agents then run; "
                "if you trust whoever runs the plant, use --own-code"
            )
        listen = listen or return_path((*where.connect, *configs[0].connect))
        own = {"connect": where.connect, "listen": listen, "credentials": where.credentials}
        return ProcessOutcome(broke=run_agents(tuple(replace(config, **own) for config in configs), links_of))
    except (StoppedError, KeyboardInterrupt) as stop:
        return ProcessOutcome(interrupted=_signal_of(stop))


def _followed(recorder: LiveRecorder, run: Callable[[], str]) -> ProcessOutcome:
    broke = interrupted = ""
    try:
        with recorder:
            broke = run()
        broke = broke or recorder.failure or ("" if recorder.client.latest else UNHEARD)
    except (StoppedError, KeyboardInterrupt) as stop:
        interrupted = _signal_of(stop)
        if recorder.recorded is None:  # a whole record has its numbers
            broke = recorder.failure
    return ProcessOutcome(
        broke=broke,
        interrupted=interrupted,
        recorded=recorder.recorded,
        pacing=recorder.client.pacing,
        failed_laws=tuple(recorder.failed_laws.values()),
    )


def _say_end(recorder: LiveRecorder, config: PlantConfig) -> None:
    pacing = recorder.client.pacing
    if pacing is None or pacing.steps == 0:
        say("the run ended before its first step")
    else:
        say(f"ended at t = {recorder.client.t:.2f} s; {sentence(pacing, config.T_c / config.speed)}")


def conclude(outcome: ProcessOutcome, metrics: Request) -> ProcessOutcome:
    """Measure a run that has ended, show its report, draw its figures, and note in its folder how it ended.

    Ctrl-C and SIGTERM are good ends of a live run. Only a second one leaves it without numbers. It judges no claim of
    the paper, as people may have changed the run.
    """
    folder, recorded = metrics.folder, outcome.recorded
    if outcome.broke or recorded is None:
        set_broken(folder, outcome.broke or "the record is incomplete")
        return outcome
    (case,) = metrics.scenario.cases
    pacing = {} if outcome.pacing is None else {case: outcome.pacing}
    try:
        from gridpeers.scenarios.measured_run import write_measures  # a signal may come meanwhile
        from gridpeers.scenarios.results.plots.drawing import drawing_of
        from gridpeers.scenarios.results.plots.run_figures import draw_all
        from gridpeers.scenarios.results.report import show_summary

        report, cases = write_measures(metrics, {case: recorded}, pacing, (), place=f"{shown(folder)}/")
        draw_all(drawing_of(metrics.scenario, cases), folder / "plots", metrics.figures)
        show_summary(report, terminal(), command_line("export", shown(folder)), metrics.figures)
        set_complete(folder)
    except (StoppedError, KeyboardInterrupt) as stop:
        set_broken(folder, "interrupted while it was measured")
        return dataclasses.replace(outcome, interrupted=_signal_of(stop))
    except OSError as error:
        broke = f"its measures cannot be written: {error.strerror or error}"
        set_broken(folder, broke)
        return dataclasses.replace(outcome, broke=broke)
    return outcome


def _signal_of(stop: BaseException) -> str:
    return str(stop) or "SIGINT"


def _log() -> None:
    logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
