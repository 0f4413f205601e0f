"""A plant, an agent, or both together, in the terminal where they were started."""

from __future__ import annotations

import contextlib
import logging
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import NoReturn, TextIO

import msgspec

from agents.agent_config import AgentConfig
from agents.agent_process import run_agent
from plant.plant_config import PlantConfig
from plant.plant_process import COMPILING, READY, run_plant
from plant.realtime.pacer import sentence
from scenarios.drivers.children import Child, Children
from scenarios.drivers.fault_injector import FaultInjector
from scenarios.emulation.emulated_links import links_of
from scenarios.live.link_log import LinkLog
from scenarios.live.live_recorder import LiveRecorder
from scenarios.live.own_code import own_code
from scenarios.live.run_address import RunAddress, UsageError, is_near, near, return_path
from scenarios.live.run_client import RunClient
from scenarios.live.run_requests import check_free, configuration
from scenarios.results.record import Recorded
from scenarios.short_names import short
from wire.driver.drive import StoppedError
from wire.messages import PLANT, Pacing

LOGGED = ("roster", "warning")
"""Kinds of events that the plant writes to its log too."""

RECORDER_WAIT = 1.0
"""Least wait (s) of a plant that is recorded: without its recorder the first row would be missing."""

CHECK = 0.25
"""Time (s) between two looks at how far the run has come, for what befalls agents at certain times."""

LEAVING = 5.0
"""Time (s) that processes have to close by themselves once the plant has."""


def say(line: str, file: TextIO | None = None) -> None:
    """Print a line at once, on standard output unless said otherwise."""
    print(line, file=file, flush=True)


@dataclass(frozen=True, kw_only=True)
class ProcessOutcome:
    """How something that was started by hand ended."""

    broke: str = ""
    """Why it could not go on; empty after a good end."""
    interrupted: str = ""
    """Name of the signal that ended it: SIGINT, as Ctrl-C gives, or SIGTERM."""


class _Words:
    """Stands for standard output while the plant tells its words there, and says what they mean."""

    def __init__(self, tell: Callable[[str], None], config: PlantConfig) -> None:
        self._tell, self._config = tell, config
        self._text = ""

    def write(self, text: str) -> int:
        *words, self._text = (self._text + text).split("\n")
        for word in words:
            if word == COMPILING:  # what comes then, the plant's log tells in sentences
                self._tell(meaning(word, self._config))
        return len(text)

    def flush(self) -> None:
        pass


def meaning(word: str, config: PlantConfig) -> str:
    """What a word of the starting plant means to a person."""
    if word == COMPILING:
        return "the plant is being built; the very first time its inner loop is compiled, which takes some seconds"
    if word == READY:
        agents = f"{len(config.agents)} agents {short(config.agents)}"
        wait = config.wait_for_agents
        return f"waits up to {wait:g} s for its {agents}" if wait > 0.0 else f"waits for none of its {agents}"
    return ""


OnWhole = Callable[[Recorded, Pacing | None], None]
"""Takes the record of a run at its end, and how well the plant kept pace."""


def plant_here(
    config: PlantConfig, folder: Path | None, book: LinkLog, on_whole: OnWhole | None = None
) -> ProcessOutcome:
    """Run the plant in this process until it is told to end.

    Parameters
    ----------
    config : PlantConfig
        The plant.
    folder : Path or None
        Where to record the run.
    book : LinkLog
        Takes what is told of emulated links.
    on_whole : OnWhole, optional
        Takes the record, if it is whole.
    """
    signal.signal(signal.SIGTERM, _stop)
    _log()
    config, terminal = _recorded(config, folder), sys.stdout

    def tell(line: str) -> None:
        say(line, terminal)

    with LiveRecorder(
        config.run, near(config.listen[0]), tell, folder, untold=LOGGED, book=book, on_whole=on_whole
    ) as live_recorder:
        try:
            with contextlib.redirect_stdout(_Words(tell, config)):
                broke = run_plant(config, make_links=links_of)
        except (StoppedError, KeyboardInterrupt) as stop:
            farewell(live_recorder, config)
            return ProcessOutcome(interrupted=str(stop) or "SIGINT")
    return ProcessOutcome(broke=broke or live_recorder.lost)


def agent_here(
    where: RunAddress, name: str, listen: tuple[str, ...] | None, wait: float, *, trusts: bool = False
) -> ProcessOutcome:
    """Run an agent in this process, as the plant tells it to, until it leaves.

    Parameters
    ----------
    where : RunAddress
        The run, and where to look for it.
    name : str
        Name of its inverter.
    listen : tuple[str, ...] or None
        Where other agents can connect; None is for any free port, of all addresses if others can reach the plant.
    wait : float
        Longest wait (s) for a plant.
    trusts : bool, optional
        Whether code that only the plant names is run, though the plant may be on another host.

    Raises
    ------
    NobodyError
        If there is no plant, no such inverter, or another agent of its name.
    UsageError
        If the plant names code of somebody's own, and is not trusted.
    """
    signal.signal(signal.SIGTERM, _stop)
    _log()
    say(f"{name}: seeks the plant of {where}, for up to {wait:g} s")
    try:
        with RunClient(where) as client:
            client.find_plant(wait, lambda line: say(f"{name}: {line}"))
            config = configuration(client, name)
            check_free(client, name)
        if not (trusts or is_near(where.connect)) and (named := own_code(config)):
            raise UsageError(
                f"{name}: the plant of {where} has its agents run {' and '.join(named)}, which is code of whoever runs "
                "the plant; if you trust it, say --own-code"
            )
        listen = listen or return_path((*where.connect, *config.connect))
        config = msgspec.structs.replace(config, connect=where.connect, listen=listen)
        return ProcessOutcome(broke=run_agent(config, links_of))
    except (StoppedError, KeyboardInterrupt) as stop:
        return ProcessOutcome(interrupted=str(stop) or "SIGINT")


def all_here(
    config: PlantConfig,
    agents: tuple[AgentConfig, ...],
    logs: Path,
    folder: Path | None,
    book: LinkLog,
    on_whole: OnWhole | None = None,
) -> ProcessOutcome:
    """Run the plant and all its agents as processes of their own, until the run is ended.

    Parameters
    ----------
    config : PlantConfig
        The plant.
    agents : tuple[AgentConfig, ...]
        All agents it knows; spare ones are not started.
    logs : Path
        Folder for what the processes print.
    folder : Path or None
        Where to record the run.
    book : LinkLog
        Takes what is told of emulated links.
    on_whole : OnWhole, optional
        Takes the record, if it is whole.
    """
    signal.signal(signal.SIGTERM, _stop)
    config = _recorded(config, folder)
    endpoint = near(config.listen[0])
    over = threading.Event()
    misfortunes = FaultInjector(config.links, config.speed)

    def on_exit(child: Child) -> None:
        if child.name == PLANT:
            over.set()
        elif child.status != 0 and not over.is_set() and child.name not in misfortunes.killed:
            say(child.report(f"after t = {live_recorder.t:.2f} s"))

    def on_word(word: str) -> None:
        if said := meaning(word, config):
            say(said)

    try:
        with (
            LiveRecorder(config.run, endpoint, say, folder, book=book, on_whole=on_whole) as live_recorder,
            Children() as children,
        ):
            children.add(
                Child(PLANT, ["-m", "scenarios.emulation.emulated_plant"], config, logs / "plant.log", on_exit, on_word)
            )
            for agent in agents:
                if agent.name in config.agents:
                    agent = msgspec.structs.replace(agent, connect=(endpoint,), listen=return_path(config.listen))
                    children.add(
                        Child(
                            agent.name,
                            ["-m", "scenarios.emulation.emulated_agent"],
                            agent,
                            logs / f"{agent.name}.log",
                            on_exit,
                        )
                    )
            try:
                while not over.wait(min(misfortunes.wait, CHECK)):
                    if live_recorder.told_at is not None:
                        misfortunes.heard(live_recorder.t - config.T_c, live_recorder.told_at)
                    misfortunes.strike(children)
                children.wait(LEAVING)
            finally:
                misfortunes.end(children)
                farewell(live_recorder, config)
        plant = children[PLANT]
        broke = "" if plant.status == 0 else plant.report(f"after t = {live_recorder.t:.2f} s")
        return ProcessOutcome(broke=broke or live_recorder.lost)
    except (StoppedError, KeyboardInterrupt) as stop:
        return ProcessOutcome(interrupted=str(stop) or "SIGINT")


def farewell(live_recorder: LiveRecorder, config: PlantConfig) -> None:
    """Say how far the run came and how well it kept pace."""
    pacing = live_recorder.pacing
    if pacing is None or pacing.steps == 0:
        say("the run ended before it began")
    else:
        say(f"ended at t = {live_recorder.t:.2f} s; {sentence(pacing, config.T_c / config.speed)}")


def _recorded(config: PlantConfig, folder: Path | None) -> PlantConfig:
    """The plant with its recorder, for which it waits a moment even if it waits for nobody else."""
    wait = config.wait_for_agents if folder is None else max(RECORDER_WAIT, config.wait_for_agents)
    return msgspec.structs.replace(config, recorders=(LiveRecorder.NAME,), wait_for_agents=wait)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    raise StoppedError(signal.Signals(number).name)


def _log() -> None:
    logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
