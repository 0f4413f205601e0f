"""What a visitor has heard of a run, put together: telemetry of the plant, status of the agents, tokens, nameplates.

Pure: messages and the time are arguments.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection

from agents.config import AgentConfig
from scenarios.live.look import Line, Look, short
from wire.messages import AgentStatus, Pacing, PlantEvent, Telemetry

SILENT = 1.5
"""An agent whose status is older than this (s of wall time) is silent: it sends three in this time."""

_PER_INVERTER = 6
"""Values of one inverter in a row of telemetry."""

_KEPT = 100
"""Events that are remembered."""


class Picture:
    """What is known of a run.

    Parameters
    ----------
    run : str
        Name of the run.
    """

    def __init__(self, run: str) -> None:
        self._run = run
        self._plates: dict[str, AgentConfig] = {}
        self._inverters: tuple[str, ...] = ()
        self._row: tuple[float, ...] = ()
        self._t: float | None = None
        self._told: float | None = None
        self._pacing: Pacing | None = None
        self._events: deque[PlantEvent] = deque(maxlen=_KEPT)
        self._status: dict[str, tuple[AgentStatus, float]] = {}

    @property
    def inverters(self) -> tuple[str, ...]:
        """Names of all inverters that were spoken of, in order."""
        others = sorted(
            (set(self._status) | set(self._plates)) - set(self._inverters), key=lambda name: (len(name), name)
        )
        return self._inverters + tuple(others)

    def plate(self, config: AgentConfig) -> None:
        """Note who an agent is."""
        self._plates[config.name] = config

    def telemetry(self, message: Telemetry, now: float) -> None:
        """Note what the plant tells; `now` is the visitor's clock (s)."""
        if self._t is not None and message.t < self._t:  # another life of the plant
            self._events.clear()
        self._inverters, self._t, self._told = message.inverters, message.t, now
        self._pacing = message.pacing or self._pacing
        if message.rows:
            self._row = message.rows[-1]
        self._events.extend(message.events)

    def status(self, message: AgentStatus, now: float) -> None:
        """Note how an agent fares."""
        self._status[message.sender] = (message, now)

    def look(self, present: Collection[str], now: float) -> Look:
        """See it at one moment.

        Parameters
        ----------
        present : Collection[str]
            Inverters whose agents have a token.
        now : float
            The visitor's clock (s).
        """
        pace = self._pace()
        if self._told is not None and now - self._told > SILENT:
            pace = f"the plant has been silent for {now - self._told:.0f} s"
        names = dict.fromkeys((*self.inverters, *sorted(present)))
        return Look(
            run=self._run,
            t=self._t,
            pace=pace,
            lines=tuple(self._line(name, name in present, now) for name in names),
            events=tuple((event.t, event.text) for event in self._events),
        )

    def _line(self, name: str, present: bool, now: float) -> Line:
        f = P = Q = V = P_set = V_set = None
        if name in self._inverters and self._row:
            start = 1 + _PER_INVERTER * self._inverters.index(name)
            f, P, Q, V, P_set, V_set = self._row[start : start + _PER_INVERTER]
        plate = self._plates.get(name)
        status, at = self._status.get(name, (None, now))
        if not present or now - at > SILENT:
            status = None
        ages = dict(zip(status.neighbours, status.ages, strict=False)) if status else {}
        return Line(
            name=name,
            kind=plate.kind if plate else "",
            island=status.island if status else "",
            f=f,
            P=None if P is None else P / 1e3,
            P_set=None if P_set is None else P_set / 1e3,
            P_share=None if P is None or plate is None else P / plate.P_rated,
            Q=None if Q is None else Q / 1e3,
            V=None if V is None or plate is None else V / plate.V_nom,
            V_set=None if V_set is None or plate is None else V_set / plate.V_nom,
            ages={neighbour: age for neighbour, age in ages.items() if status and neighbour in status.used},
            received=status.received if status else None,
            sent=status.sent if status else None,
            lost=status.lost if status else None,
            rejected=status.rejected if status else None,
            note=_note(status, name in self._status, present, now - at),
        )

    def _pace(self) -> str:
        pacing = self._pacing
        if pacing is None or pacing.steps == 0:
            return ""
        text = f"pace: {100.0 * (1.0 - pacing.late / pacing.steps):.2f} % of steps in time"
        text += f" (p50 {1e3 * pacing.p50:.1f} ms, p99 {1e3 * pacing.p99:.1f} ms)"
        return text + (f", fell behind by {pacing.slipped:.1f} s" if pacing.slipped > 0.0 else "")


def _note(status: AgentStatus | None, known: bool, present: bool, age: float) -> str:
    """What a person should know of an agent; age (s) is that of its last status."""
    if not present:
        return "no agent"
    if status is None:
        return f"silent for {age:.0f} s" if known else "has not told yet"
    if status.phase != "running":
        return f"waits for {status.waits_for}" if status.waits_for else status.phase
    unused = [name for name in status.neighbours if name not in status.used]
    return f"without {short(unused)}" if unused else ""
