"""What an agent in wall-clock time has done since its start, and how it says so. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from agents.config import AgentConfig
from agents.freerun.heard import Heard
from wire.bounds import MOST_COUNT
from wire.messages import AgentStatus
from wire.printable import printable

Phase = Literal["seeking", "waiting", "running"]


@dataclass
class Tally:
    """Counts since the start."""

    ticks: int = 0
    """Ticks done."""
    missed: int = 0
    """Ticks skipped, as their time was over."""
    sent: int = 0
    """States sent; the number of the next."""
    used: int = 0
    """Messages that came in and were used."""
    lost: int = 0
    """Messages that did not come off the wire, as the numbers of those that did show."""
    lateness: float = 0.0
    """Longest delay of a tick behind its time since the last status (s of wall time)."""

    def woken(self, late: float, skipped: int) -> None:
        """Note a tick: how late it was (s of wall time), and how many were skipped for it."""
        self.missed += skipped
        self.lateness = max(self.lateness, late)

    def take_status(
        self,
        config: AgentConfig,
        phase: Phase,
        heard: Heard,
        now: float,
        *,
        awaited: tuple[str, ...],
        neighbours: tuple[str, ...],
        in_sums: tuple[str, ...],
        rejected: int,
        dropped: int,
        impaired: tuple[str, ...],
    ) -> AgentStatus:
        """How the agent fares now (s on its clock); see `AgentStatus`."""
        others = f", which waits for {', '.join(awaited)}" if awaited else ""
        waits_for = {
            "seeking": f"the plant of run {config.run}",
            "waiting": f"a measurement of {config.name} from the plant{others}",
            "running": "",
        }
        ages = [heard.age(name, now) for name in neighbours]
        lateness, self.lateness = self.lateness, 0.0
        return AgentStatus(
            sender=config.name,
            incarnation=config.incarnation,
            seq=self.sent,
            t=heard.t,
            phase=phase,
            waits_for=printable(waits_for[phase]),
            island="" if heard.measurement is None else heard.measurement.island,
            neighbours=neighbours,
            ages=tuple(age if age < float("inf") else -1.0 for age in ages),
            used=in_sums,
            received=self.used,
            sent=self.sent,
            rejected=rejected,
            lost=min(self.lost + dropped, MOST_COUNT),
            ticks=self.ticks,
            missed=self.missed,
            lateness=lateness,
            impaired=impaired,
        )
