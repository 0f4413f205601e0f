"""What a soak knows of its run: who uses whom, the frequency, the plant's events and its late steps. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.equipment import F_NOM
from gridpeers.scenarios.results.metrics import F_BAND
from gridpeers.wire.messages import VALUES, AgentStatus, Pacing, PlantEvent, Telemetry

HOLD = 0.5
"""Run time (s) for which the frequency must stay in its band to count as restored."""

OFFSETS = 50
"""Latest messages of the plant by which run time and real time are compared."""


class SoakMonitor:
    """Takes the messages of a run in real time at speed 1."""

    def __init__(self) -> None:
        self.inverters: tuple[str, ...] = ()
        """Names of all inverters."""
        self.off: set[str] = set()
        """Inverters that are off the network: their frequency does not count."""
        self.t = -1.0
        """Run time (s) of the latest row."""
        self.pacing: Pacing | None = None
        """The plant's account of its steps."""
        self.events: deque[tuple[float, PlantEvent]] = deque(maxlen=1000)
        """Events with the time of their arrival (s, monotonic)."""
        self.restorations: list[float] = []
        """How long (s) the frequency of a grid-forming inverter was out of its band, each time until it held."""
        self._out_since: float | None = None
        self._GFM: set[str] = set()
        self._in_band_since: float | None = None
        self._offsets: deque[float] = deque(maxlen=OFFSETS)
        self._statuses: dict[str, tuple[float, AgentStatus]] = {}

    def config(self, config: AgentConfig) -> None:
        """Take the configuration of an agent."""
        if config.kind == "GFM":
            self._GFM.add(config.name)

    def telemetry(self, message: Telemetry, now: float) -> None:
        """Take the plant's telemetry."""
        self.inverters, self.pacing = message.inverters, message.pacing
        self.events += [(now, event) for event in message.events]
        judged = [i for i, name in enumerate(message.inverters) if name in self._GFM and name not in self.off]
        for row in message.rows:
            self.t = row[0]
            self._judge(max((abs(row[1 + VALUES * i] - F_NOM) for i in judged), default=0.0))
        self._offsets.append(now - self.t)

    def status(self, message: AgentStatus, now: float) -> None:
        """Take the status of an agent."""
        self._statuses[message.sender] = now, message

    def real_time(self, t: float) -> float:
        """Return the time (s, monotonic) of a run time (s)."""
        return t + min(self._offsets)

    def use(self, agent: str, neighbour: str, since: float = 0.0) -> bool:
        """Return whether an agent has a neighbour in its sums, by a status that came after a time (s, monotonic)."""
        at, status = self._statuses.get(agent, (-1.0, None))
        return status is not None and at > since and neighbour in status.used

    def use_each_other(self, one: Iterable[str], others: Iterable[str], since: float = 0.0) -> bool:
        """Return whether each of some agents and each of others have each other in their sums."""
        there = tuple(others)
        return all(self.use(a, b, since) and self.use(b, a, since) for a in one for b in there if a != b)

    def none_uses(self, agent: str, others: Iterable[str]) -> bool:
        """Return whether no other agent has an agent in its sums."""
        return not any(self.use(other, agent) for other in others)

    def told(self, subject: str, words: str, since: float) -> bool:
        """Return whether the plant has told something about an agent since a time (s, monotonic)."""
        return any(at > since and event.subject == subject and words in event.text for at, event in self.events)

    def _judge(self, error: float) -> None:
        """Note the largest abs(f - 60 Hz) (Hz) of the latest row."""
        if error >= F_BAND:
            self._in_band_since = None
            if self._out_since is None:
                self._out_since = self.t
            return
        if self._in_band_since is None:
            self._in_band_since = self.t
        if self._out_since is not None and self.seconds_in_band >= HOLD:
            self.restorations.append(self._in_band_since - self._out_since)
            self._out_since = None

    @property
    def seconds_in_band(self) -> float:
        """How long (s of run time) the frequency of every grid-forming inverter has been in its band."""
        if self._in_band_since is None or not self._GFM:
            return 0.0
        return self.t - self._in_band_since
