"""Run a plant, an agent, or both together, from the terminal in which they were started."""

from __future__ import annotations

import logging
import re
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_process import run_agents
from gridpeers.plant.known_names import COMPILING, READY
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_process import run_plant
from gridpeers.plant.realtime.pacer import sentence
from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.drivers.forking import release
from gridpeers.scenarios.drivers.supervisor import Supervisor
from gridpeers.scenarios.drivers.telemetry_client import with_recorder
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.scenarios.live.live_files import LinkLog
from gridpeers.scenarios.live.live_recorder import LiveRecorder
from gridpeers.scenarios.live.run_address import RunAddress, UsageError, is_loopback, loopback_of, return_path
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.live.run_requests import ANSWER, check_free, configuration, own_code
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.short_texts import short
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.ending import StopSignal, stop_at_signals
from gridpeers.wire.messages import PLANT, Pacing, PlantEvent
from gridpeers.wire.timing import RateLimit
from gridpeers.wire.wording import printable

LOGGED = ("roster", "warning")
"""Kinds of events that a plant in this process also writes to its log."""

CHECK = 0.25
"""Time (s) between two checks for process faults that are due."""

UNHEARD = "the plant has ended, and nothing was ever heard of it here: no link to it was made"
"""Failure of a run whose plant ended without an error, but was never heard here."""

LEAVING = 5.0
"""Time (s) that processes have to close by themselves once the plant has."""


def say(line: str) -> None:
    """Print a line on standard output at once."""
    print(line, flush=True)


@dataclass(frozen=True, kw_only=True)
class ProcessOutcome:
    """The outcome of a live run in the terminal where it was started."""

    broke: str = ""
    interrupted: str = ""
    """Name of the signal that ended it: SIGINT, as Ctrl-C gives, or SIGTERM."""
    recorded: Recorded | None = None
    """The record, if it is whole."""
    pacing: Pacing | None = None
    failed_laws: tuple[PlantEvent, ...] = ()


def meaning(word: str, config: PlantConfig) -> str:
    """Return a sentence for a line that the plant prints; "" for one that needs none.

    It prints a word at each step of its start, and Zenoh's line for each TLS handshake that has failed.
    """
    if word == COMPILING:
        return "the plant is being built; the very first time its inner loop is compiled, which takes some seconds"
    if word == READY:
        agents = f"{len(config.agents)} agents {short(config.agents)}"
        wait = config.wait_for_agents
        return f"waits up to {wait:g} s for its {agents}" if wait > 0.0 else f"waits for none of its {agents}"
    refused = re.search(r"WARN.*zenoh_link_tls\S*\s(.*?)(?:\. Hint:.*)?$", word)
    return f"a link was refused: {printable(refused[1])}" if refused else ""


def plant_here(config: PlantConfig, folder: Path | None, link_log: LinkLog, record: RecordInfo) -> ProcessOutcome:
    """Run the plant in this process until it is told to end."""
    requests = stop_at_signals(StoppedError)
    _log()
    config = with_recorder(config, waits=folder is not None)

    def on_word(word: str) -> None:
        if word == COMPILING:  # the plant's log reports the rest
            say(meaning(word, config))

    def run(recorder: LiveRecorder) -> str:
        return run_plant(config, make_links=links_of, on_word=on_word)

    recorder = LiveRecorder(config, say, folder, link_log, record, silent=LOGGED)
    outcome = _follow(recorder, run, requests)
    if outcome.interrupted:  # else the plant has said it
        _say_end(recorder, config)
    return outcome


def all_here(
    config: PlantConfig,
    agents: tuple[AgentConfig, ...],
    logs: Path,
    folder: Path | None,
    link_log: LinkLog,
    record: RecordInfo,
) -> ProcessOutcome:
    """Run the plant and its agents, but for spare ones, as processes of their own, until the run ends."""
    requests = stop_at_signals(StoppedError)
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

    def run(recorder: LiveRecorder) -> str:
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
    recorder = LiveRecorder(config, say, folder, link_log, record)
    outcome = _follow(recorder, run, requests)
    _say_end(recorder, config)
    return outcome


def agent_here(
    where: RunAddress, names: tuple[str, ...], listen: tuple[str, ...] | None, wait: float, *, trusts: bool = False
) -> ProcessOutcome:
    """Run agents in this process, in one session, with the configurations that the plant hands out, until they leave.

    They wait for `wait` (s) for the plant and its answers. `listen` is where other agents connect; None takes any free
    port, of all addresses if others can reach the plant. UsageError if the plant names code that does not come with
    gridpeers, may be on another host, and is not trusted; NobodyError if there is no plant, no such inverter, or
    another agent of it.
    """
    stop_at_signals(StoppedError)
    _log()
    who = ", ".join(names)
    say(f"{who}: seeks the plant of {where}, for up to {wait:g} s")
    try:
        with RunClient(where) as client:
            end = monotonic() + wait
            client.find_plant(wait, lambda line: say(f"{who}: {line}"))
            configs = [configuration(client, name, max(ANSWER, end - monotonic())) for name in dict.fromkeys(names)]
            for name in names:
                check_free(client, name)
        named = list(dict.fromkeys(code for config in configs for code in own_code(config)))
        if named and not (trusts or is_loopback(where.connect)):
            raise UsageError(
                f"{who}: the plant of {where} has its agents run {' and '.join(named)}, which is code of whoever runs "
                "the plant; if you trust it, say --own-code"
            )
        listen = listen or return_path((*where.connect, *configs[0].connect))
        process = tuple(
            replace(config, connect=where.connect, listen=listen, credentials=where.credentials) for config in configs
        )
        return ProcessOutcome(broke=run_agents(process, links_of))
    except (StoppedError, KeyboardInterrupt) as stop:
        return ProcessOutcome(interrupted=_signal_of(stop))


def _follow(recorder: LiveRecorder, run: Callable[[LiveRecorder], str], requests: StopSignal) -> ProcessOutcome:
    """Run something with its recorder until it returns why it broke, or a signal ends it."""
    broke = interrupted = ""
    try:
        with recorder:
            try:
                broke = run(recorder)
            except (StoppedError, KeyboardInterrupt) as stop:
                if requests.requests > 1:
                    recorder.cut_short = f"{_signal_of(stop)} came again before the plant had ended"
                raise
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
        say("the run ended before it began")
    else:
        say(f"ended at t = {recorder.client.t:.2f} s; {sentence(pacing, config.T_c / config.speed)}")


def _signal_of(stop: BaseException) -> str:
    return str(stop) or "SIGINT"


def _log() -> None:
    logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
