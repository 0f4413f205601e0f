"""The paper's feeder in wall-clock time with an observer, who notes when what he sees came, and who hurts agents."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Literal

import numpy as np
from msgspec.structs import replace
from ping import STAMP, StampedInbox, stamp_of

from plant.equipment import F_NOM
from scenarios.drivers.children import Child, Children
from scenarios.live.live_options import LiveOptions, configure
from scenarios.results.metrics import F_BAND, MPSI_BAND, sharing_index
from scenarios.schema import load_scenario
from wire.codec import decode, encode
from wire.driver.session import Session
from wire.keys import Keys
from wire.messages import PLANT, AgentStatus, Command, Measurement, PlantEvent, State, Telemetry

RUN = "latency"
OBSERVER = "observer"

PATIENCE = 30.0
"""Longest wait (s) for anything, the plant's first compilation apart."""

QUIET = 2.0
"""Time (s) after which an agent that works but is not heard is out of reach; it reports twice a second."""

BUILD = 600.0
"""Longest wait (s) for the plant to stand."""

HOLD = 0.5
"""How long (s of run time) the bands must hold to count as restored; longer than noticing takes."""

_AGENT = "scenarios.emulation.emulated_agent"
"""Agents by hand stand behind emulated links, that somebody may hurt."""

_ELSEWHERE = "import os, sys; os.execvp(sys.argv[1], sys.argv[1:])"
"""What becomes another command, with the process id and the standard input of this one."""


class NotInTimeError(Exception):
    """Something did not come; the message says what."""


class Watched:
    """A plant, its agents and the observer. Use it as a context: no process is left.

    Parameters
    ----------
    folder : Path
        For the logs.
    endpoint : str
        Where the plant listens.
    listen : str
        Where agents listen.
    elsewhere : dict[str, tuple[str, list[str]]]
        Agents on another host: where they listen, and what stands before their command.
    """

    def __init__(self, folder: Path, endpoint: str, listen: str, elsewhere: dict[str, tuple[str, list[str]]]) -> None:
        scenario, feeder = load_scenario("islanding")
        scenario = replace(scenario, events=scenario.events[:1])
        self.plant_config, agents = configure(
            scenario, feeder, LiveOptions(run=RUN, case="IV", wait=PATIENCE), endpoint
        )
        self.names = self.plant_config.agents
        self._places = {name: elsewhere.get(name, (listen, [])) for name in self.names}
        self.agents = {
            agent.name: replace(agent, connect=(endpoint,), listen=(self._places[agent.name][0],), deadline=BUILD)
            for agent in agents
            if agent.name in self.names
        }
        self.endpoint, self.keys, self.children = endpoint, Keys(RUN), Children()
        self.telemetry: Telemetry | None = None
        self.events: list[PlantEvent] = []
        self.tokens: dict[str, float] = {}
        """Agents whose token is there, and when it came."""
        self.used: dict[str, tuple[str, ...]] = {}
        """Of each agent who is in its sums."""
        self.turns: list[tuple[float, str, str, bool]] = []
        """When, in whose sums, who came in (True) or went out, since `mark`."""
        self.size = 0
        """Bytes of a State."""
        self._judged: tuple[str, ...] = self.names
        self._verdicts: list[tuple[float, bool]] = []
        self._offsets: deque[float] = deque(maxlen=250)
        self._folder, self._listen, self._commands = folder, listen, 0
        self._reports: dict[str, float] = {}
        """When the last status of each agent came."""
        self.session = self._open()

    def _open(self) -> Session:
        session = Session(OBSERVER, listen=(self._listen,), connect=(self.endpoint,), clock="wall")
        session.inbox = StampedInbox()
        for key in (self.keys.telemetry, self.keys.measurement(self.names[0]), self.keys.state(self.names[0])):
            session.subscribe(key)
        for name in self.names:
            session.subscribe(self.keys.status(name))
        session.watch(self.keys.any_alive)
        return session

    def listen_again(self) -> bool:
        """Open a new session if a running agent is not heard any more, until all are heard. Whether that was so."""
        since, deaf = monotonic(), False

        def heard() -> bool:
            return all(self._reports.get(name, 0.0) > since for name in self.names)

        try:
            self.until(heard, "a status of everybody", QUIET)
        except NotInTimeError:
            deaf = True
            self.session.close()
            self.tokens.clear()
            self.session = self._open()
            self.until(heard, "a status of everybody")
        return deaf

    def __enter__(self) -> Watched:
        """Start everybody; return when all nine share, in the island."""
        try:
            self.start(PLANT, *self.names)
            self.until(lambda: self.telemetry is not None and self.telemetry.t > 2.0, "the run begins", BUILD)
            self.listen_again()
            self.at_rest()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End everybody."""
        self.session.close()
        self.children.end()

    def start(self, *names: str) -> None:
        """Start processes; one of a name that has run before is started anew."""
        for name in names:
            for former in self.children.lives(name):
                former.release()
            self.used.pop(name, None)
            log = self._folder / f"{name}-{len(self.children.lives(name))}.log"
            if name == PLANT:
                child = Child(
                    name,
                    ["-m", "scenarios.emulation.emulated_plant"],
                    self.plant_config,
                    log,
                    self._ended,
                    lambda word: None,
                )
            else:
                _, prefix = self._places[name]
                command = ["-c", _ELSEWHERE, *prefix, sys.executable, "-P", "-m", _AGENT] if prefix else ["-m", _AGENT]
                child = Child(name, command, self.agents[name], log, self._ended)
            self.children.add(child)

    def _ended(self, child: Child) -> None:
        self.session.inbox.put(("word", child.name, b""))

    # ---------------------------------------------------------------- waiting

    def until(self, condition: Callable[[], bool], what: str, patience: float = PATIENCE) -> None:
        """Take in messages until a condition holds."""
        end = monotonic() + patience
        while not condition():
            left = end - monotonic()
            if left <= 0.0:
                ends = [child.report("") for name in self.names if (child := self.children[name]).status is not None]
                raise NotInTimeError("\n".join((f"not within {patience:g} s: {what}; sums {self.used}", *ends)))
            for kind, key, payload, _ in self.session.inbox.take(1, left):
                self._take(kind, key, payload)
            if self.children[PLANT].status is not None:
                raise NotInTimeError(self.children[PLANT].report("while it was needed"))

    def at_rest(self) -> None:
        """Wait until all use each other and the bands have held for a while; then begin anew to note what comes."""
        self.mark(self.names)
        self.all_use(*self.names)
        self.restored(self.names, self.t)

    def mark(self, judged: Sequence[str]) -> None:
        """Forget what was noted; from now on the bands are those of these inverters."""
        self._judged = tuple(judged)
        self.turns.clear()
        self.events.clear()
        self._verdicts.clear()

    def all_use(self, *names: str, patience: float = PATIENCE) -> None:
        """Wait until each of these has all the others, and nobody else, in its sums."""
        self.until(
            lambda: all({*self.used.get(name, ())} == {*names} - {name} for name in names),
            f"{', '.join(names)} use each other",
            patience,
        )

    def turned(self, name: str, into: bool) -> tuple[float, float]:
        """Wait until somebody is in the sums of all others, or of none; when the first and the last turned."""
        others = [other for other in self.names if other != name]
        self.until(
            lambda: all((name in self.used.get(other, ())) == into for other in others),
            f"{name} {'in' if into else 'out of'} the sums of the others",
        )
        first = {who: at for at, who, whom, way in reversed(self.turns) if whom == name and way == into}
        return min(first.values()), max(first.values())

    def event(self, kind: str, text: str) -> float:
        """Wait for an event since `mark`; its run time (s)."""
        found: list[PlantEvent] = []

        def came() -> bool:
            found[:] = [event for event in self.events if event.kind == kind and text in event.text]
            return bool(found)

        self.until(came, f"event {kind}: {text}")
        return found[0].t

    def restored(self, names: Sequence[str], since: float) -> float:
        """Wait until f and sharing of the judged inverters have held for `HOLD` s; when that began (s)."""
        begin = [since]

        def held() -> bool:
            rows = [(t, ok) for t, ok in self._verdicts if t >= since]
            last_bad = max((i for i, (_, ok) in enumerate(rows) if not ok), default=-1)
            good = rows[last_bad + 1 :]
            begin[0] = good[0][0] if good else since
            return bool(good) and good[-1][0] - good[0][0] >= HOLD

        assert tuple(names) == self._judged
        self.until(held, f"60 Hz and equal sharing of {', '.join(names)}")
        return begin[0] + min(self._offsets)

    @property
    def t(self) -> float:
        """Run time (s) of the latest telemetry."""
        return -1.0 if self.telemetry is None else self.telemetry.t

    # ---------------------------------------------------------------- doing

    def signal(self, name: str, number: int) -> float:
        """Send a signal to an agent's process; when."""
        self.children[name].signal(number)
        return monotonic()

    def switch(self, name: str, verb: Literal["open", "close"]) -> None:
        """Operate a switch."""
        self._commands += 1
        command = Command(
            sender=OBSERVER, epoch=1, seq=self._commands, t=0.0, verb=verb, argument=name, reply_to=OBSERVER
        )
        self.session.publish(self.keys.command, encode(command))

    # ---------------------------------------------------------------- what comes

    def _take(self, kind: str, key: str, stamped: bytes) -> None:
        at, payload = stamp_of(stamped), stamped[STAMP:]
        match self.keys.parts(key):
            case ("alive", "agent", name, _) if kind == "appeared":
                self.tokens[name] = at
            case ("alive", "agent", name, _) if kind == "vanished":
                self.tokens.pop(name, None)
        if kind != "message":
            return
        message = decode(payload)
        if isinstance(message, State):
            self.size = len(payload)
        elif isinstance(message, Measurement):
            self._offsets.append(at - message.t)
        elif isinstance(message, AgentStatus):
            self._reports[message.sender] = at
            before, now = {*self.used.get(message.sender, ())}, {*message.used}
            self.turns += [(at, message.sender, name, name in now) for name in sorted(before ^ now)]
            self.used[message.sender] = message.used
        elif isinstance(message, Telemetry):
            self.telemetry = message
            self.events += message.events
            self._judge(message)

    def _judge(self, telemetry: Telemetry) -> None:
        """Judge rows: every GFM within the band of frequency, and MPSI of those that take part within its own."""
        if not telemetry.rows:
            return
        rows = np.array(telemetry.rows)
        at = [telemetry.inverters.index(name) for name in self._judged]
        nameplates = [self.agents[name] for name in self._judged]
        GFM = [i for i, plate in zip(at, nameplates, strict=True) if plate.kind == "GFM"]
        index = sharing_index(
            rows[:, [2 + 6 * i for i in at]],
            np.array([plate.P_rated for plate in nameplates]),
            np.array([plate.m_p for plate in nameplates]),
        )
        error = np.abs(rows[:, [1 + 6 * i for i in GFM]] - F_NOM).max(axis=1)
        verdicts = (error < F_BAND) & (index < MPSI_BAND)
        self._verdicts += zip(rows[:, 0].tolist(), verdicts.tolist(), strict=True)


def describe(samples: Sequence[float]) -> str:
    """Return the columns of n, p50, p95 and max (ms)."""
    p50, p95, worst = (1e3 * float(np.percentile(samples, q)) for q in (50, 95, 100))
    return f"{len(samples):6} {p50:9.2f} {p95:9.2f} {worst:9.2f}"
