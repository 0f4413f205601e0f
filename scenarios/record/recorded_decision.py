"""One decision of an agent as recorded: its inputs, what it left out and why, and the state that came out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gridpeers.agents.agent import neighbour_of, own_of
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.laws.law import Neighbour, Own
from gridpeers.wire.messages import Measurement, Nameplate, State

Action = Literal["law", "hold", "off", "idle"]
"""What an agent does at a tick: its law decides; secondary control is on hold, as the inverter is grid-connected or has
none; the inverter is out of service; the agent is paused, without a measurement, or its law has failed."""

_IN_WORDS: dict[Action, str] = {
    "law": "its law decided",
    "hold": "secondary control was on hold while grid-connected: the set-points follow the plant's",
    "off": "its inverter was out of service: nothing to control",
    "idle": "it was idle: paused, without a measurement, or its law has failed",
}


@dataclass(frozen=True, kw_only=True)
class NeighbourInput:
    """An in-neighbour of an agent at a decision."""

    nameplate: Nameplate
    state: State | None
    number: int | None
    """Number of that state, also if the record does not have it; None if there was none."""
    age: float | None
    """Age of that state (s of run time); None if there was none."""
    weight: float
    """Weight from 0 to 1 of that state in the sums."""
    unused: str
    """Why it was left out: "silent", "stale" or "island" (`gridpeers.wire.journal.Decision`); empty if it was used."""
    lie: str = ""
    """The lie that `state` is, in words; empty if it is as its sender decided it."""

    @property
    def name(self) -> str:
        return self.nameplate.sender


@dataclass(frozen=True, kw_only=True)
class RecordedDecision:
    """One decision of an agent. SI units; `own` and `neighbours_used` have them per unit, as the law saw them."""

    config: AgentConfig
    tick: int
    """Number of the own state: in simulated time the tick k, at t = k T_c."""
    at: float | None
    """Time on the agent's clock (s, monotonic); None in simulated time."""
    measurement: Measurement
    """Own measurement as the agent used it. Its `t` is the run time of the decision."""
    measurement_age: int
    """Simulated time: age of the values of the measurement in ticks; 0 without an emulated link."""
    neighbours: tuple[NeighbourInput, ...]
    """In-neighbours by the graph that the agent had met, in the order in which the law sums over them."""
    not_met: tuple[str, ...]
    """Agents of the run that the graph makes in-neighbours, but that were not there: not started, gone, or not met."""
    before: tuple[float, float]
    restarted: bool
    """True if the agent started, or started again after a pause, from the set-points of its measurement."""
    saturated: tuple[int, int]
    """Saturated sides of P and V: 1, -1 or 0; see `gridpeers.agents.laws.law.Own`."""
    action: Action
    state: State

    @property
    def is_whole(self) -> bool:
        """True if the record has all states that the agent used: a record that is cut off may lack the last ones."""
        return all(each.state is not None for each in self.neighbours if each.number is not None and not each.unused)

    @property
    def agent(self) -> str:
        return self.config.name

    @property
    def t(self) -> float:
        """Run time of the decision (s): that of its measurement."""
        return self.measurement.t

    @property
    def after(self) -> tuple[float, float]:
        """Set-points (W, V) after the decision, as `before`."""
        return self.state.P_set, self.state.V_set

    @property
    def own(self) -> Own:
        """The own inverter as the law saw it (pu)."""
        return own_of(self.config, self.measurement, *self.before, self.saturated)

    @property
    def neighbours_used(self) -> tuple[Neighbour, ...]:
        """The neighbours in the sums as the law saw them (pu), in its order."""
        return tuple(
            neighbour_of(each.nameplate, each.state, each.age, each.weight)
            for each in self.neighbours
            if not each.unused and each.state is not None and each.age is not None
        )

    @property
    def takes_part(self) -> bool:
        return self.config.control.acts(self.config.name, self.config.kind)

    @property
    def in_words(self) -> str:
        if self.action == "hold" and not self.takes_part:
            return "it has no secondary control in this case: the set-points are those that the plant holds"
        return _IN_WORDS[self.action]

    @property
    def T(self) -> float:
        """Control period (s) that the law was called with."""
        realtime = self.config.clock == "realtime"
        return self.config.T_c if realtime else self.config.by_own_clock().T_c
