"""Counts of an agent under real time since its start, and its status message. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.neighbour_states import NeighbourStates
from gridpeers.wire.bounds import MOST_COUNT
from gridpeers.wire.messages import AgentStatus
from gridpeers.wire.printable import printable

Phase = Literal["seeking", "waiting", "running"]


@dataclass
class AgentStatistics:
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
        states: NeighbourStates,
        at: float,
        *,
        missing_agents: tuple[str, ...],
        neighbours: tuple[str, ...],
        used: tuple[str, ...],
        rejected: int,
        dropped: int,
        impaired: tuple[str, ...],
    ) -> AgentStatus:
        """Report the agent's condition at this time (s of run time on its clock); see `AgentStatus`."""
        others = f", which waits for {', '.join(missing_agents)}" if missing_agents else ""
        waits_for = {
            "seeking": f"the plant of run {config.run}",
            "waiting": f"a measurement of {config.name} from the plant{others}",
            "running": "",
        }
        ages = [states.age(name, at) for name in neighbours]
        lateness, self.lateness = self.lateness, 0.0
        return AgentStatus(
            sender=config.name,
            epoch=config.epoch,
            seq=self.sent,
            t=states.t,
            phase=phase,
            waits_for=printable(waits_for[phase]),
            island="" if states.measurement is None else states.measurement.island,
            neighbours=neighbours,
            ages=tuple(age if age < inf else -1.0 for age in ages),
            used=used,
            received=self.used,
            sent=self.sent,
            rejected=rejected,
            lost=min(self.lost + dropped, MOST_COUNT),
            ticks=self.ticks,
            missed=self.missed,
            lateness=lateness,
            impaired=impaired,
        )
