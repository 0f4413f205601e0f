"""The paper's feeder in real time with an observer, which notes when messages came and injects faults into agents."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Literal

import numpy as np
from msgspec.structs import replace

from plant.equipment import F_NOM
from scenarios.drivers.supervisor import Supervisor
from scenarios.live.client.run_address import RunAddress
from scenarios.live.client.run_client import RunClient
from scenarios.live.launch.live_options import LiveOptions, configure
from scenarios.results.metrics import F_BAND, MPSI_BAND
from scenarios.results.sharing_index import sharing_index
from scenarios.schema import load_scenario
from wire.codec import decode, encode
from wire.messages import PLANT, AgentStatus, Command, Measurement, PlantEvent, State, Telemetry

RUN = "latency"
OBSERVER = "observer"

PATIENCE = 30.0
"""Longest wait (s) for anything, the plant's first compilation apart."""

QUIET = 2.0
"""Time (s) after which an agent that works but is not heard is out of reach; it reports twice a second."""

BUILD = 600.0
"""Longest wait (s) for the plant to be built."""

HOLD = 0.5
"""Run time (s) for which the bands must hold to count as restored; longer than noticing takes."""

LOOK = 0.5
"""Longest wait (s) between two looks at a condition that no message may end."""


class NotInTimeError(Exception):
    """A condition did not come true in time; the message names it."""


def _ignore(_: object) -> None:
    """Take no notice: the observer looks at the processes itself."""


class RunObserver:
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
        plant, agents = configure(scenario, feeder, LiveOptions(run=RUN, case="IV", wait=PATIENCE), endpoint)
        self.names = plant.agents
        self.agents = {
            agent.name: replace(agent, connect=(endpoint,), listen=(elsewhere.get(agent.name, (listen, []))[0],))
            for agent in agents
            if agent.name in self.names
        }
        prefixes = {name: prefix for name, (_, prefix) in elsewhere.items()}
        self._supervisor = Supervisor(plant, self.agents.values(), folder, _ignore, _ignore, prefixes=prefixes)
        self.endpoint, self.children = endpoint, self._supervisor.children
        self.telemetry: Telemetry | None = None
        self.events: list[PlantEvent] = []
        self.tokens: dict[str, float] = {}
        """Time (s, monotonic) at which the token of each present agent came."""
        self.used: dict[str, tuple[str, ...]] = {}
        """By agent, the neighbours in its sums."""
        self.turns: list[tuple[float, str, str, bool]] = []
        """Since `mark`: when a neighbour came into an agent's sums (True) or went out: time, agent, neighbour."""
        self.size = 0
        """Bytes of a State."""
        self._judged: tuple[str, ...] = self.names
        self._verdicts: list[tuple[float, bool]] = []
        self._offsets: deque[float] = deque(maxlen=250)
        self._commands = 0
        self._reports: dict[str, float] = {}
        """Time at which the last status of each agent came."""
        self._client = RunClient(RunAddress(run=RUN, connect=(endpoint,)), listen=(listen,))
        self.keys = self._client.keys
        for key in (self.keys.telemetry, self.keys.measurement(self.names[0]), self.keys.state(self.names[0])):
            self._client.listen(key)
        for name in self.names:
            self._client.listen(self.keys.status(name))

    def listen_again(self) -> bool:
        """Open a new session if a running agent is not heard any more, until all are heard; return whether it did."""
        since, deaf = monotonic(), False

        def heard() -> bool:
            return all(self._reports.get(name, 0.0) > since for name in self.names)

        try:
            self.until(heard, "a status of every agent", QUIET)
        except NotInTimeError:
            deaf = True
            self.tokens.clear()
            self._client.renew()
            self.until(heard, "a status of every agent")
        return deaf

    def __enter__(self) -> RunObserver:
        """Start all processes; return once all nine agents share, in the island."""
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
        """End all processes."""
        self._client.__exit__(kind, error, trace)
        self._supervisor.__exit__(kind, error, trace)

    def start(self, *names: str) -> None:
        """Start processes, or start them again."""
        for name in names:
            self.used.pop(name, None)
        self._supervisor.start(*names)

    # ---------------------------------------------------------------- waiting

    def until(self, condition: Callable[[], bool], what: str, patience: float = PATIENCE) -> None:
        """Take in messages until a condition holds."""
        end = monotonic() + patience
        while not condition():
            left = end - monotonic()
            if left <= 0.0:
                ends = [child.report("") for name in self.names if (child := self.children[name]).status is not None]
                raise NotInTimeError("\n".join((f"not within {patience:g} s: {what}; sums {self.used}", *ends)))
            for key, payload, at in self._client.take(min(left, LOOK)):
                self._take(key, payload, at)
            self._note_tokens()
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
        """Wait until an agent is in the sums of all others, or of none; return the times of the first and the last."""
        others = [other for other in self.names if other != name]
        self.until(
            lambda: all((name in self.used.get(other, ())) == into for other in others),
            f"{name} {'in' if into else 'out of'} the sums of the others",
        )
        first = {who: at for at, who, whom, way in reversed(self.turns) if whom == name and way == into}
        return min(first.values()), max(first.values())

    def event(self, kind: str, text: str) -> float:
        """Wait for an event since `mark`; its run time (s)."""
        events: list[PlantEvent] = []

        def came() -> bool:
            events[:] = [event for event in self.events if event.kind == kind and text in event.text]
            return bool(events)

        self.until(came, f"event {kind}: {text}")
        return events[0].t

    def restored(self, names: Sequence[str], since: float) -> float:
        """Wait until f and sharing of the judged inverters have held for `HOLD` s; return when that began (s)."""
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
        """Send a signal to an agent's process; return the time."""
        self.children[name].signal(number)
        return monotonic()

    def switch(self, name: str, verb: Literal["open", "close"]) -> None:
        """Operate a switch."""
        self._commands += 1
        command = Command(
            sender=OBSERVER, epoch=1, seq=self._commands, t=0.0, verb=verb, argument=name, reply_to=OBSERVER
        )
        self._client.publish(self.keys.command, encode(command))

    # ---------------------------------------------------------------- what comes

    def _note_tokens(self) -> None:
        present = self._client.present
        self.tokens = {name: self.tokens.get(name, monotonic()) for name in present}

    def _take(self, key: str, payload: bytes, at: float) -> None:
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
