"""When an agent ticks in real time: on its own timer, with what it heard last. Pure.

Nobody grants a tick. At each one the agent uses

- its *measurement*, if it is not older than `max_age`; else it is on hold, and sends nothing to its neighbours;
- the last state of each *neighbour* whose token is there, whose value is not older than `max_age`, and who is in the
  same island. The age is that on the own clock; but a state that was long on its way is as old as its run time says,
  beside that of the own measurement.

Ages are s of run time. Tokens say who exists, never who works: a frozen process keeps its token for seconds.

**When a tick is late** it is done at once, and the ticks missed meanwhile are left out: the schedule does not move. If
it is late by more than `max_age` (the process was frozen, or starved), the agent drops what it knew, holds its
set-points, and waits for news. Nobody waits for it: its neighbours go on without its state once that is too old.

The worst time to tick is just as the next measurement comes, now before it and now after: the set-points then miss the
plant's step, so that the loop is one period longer. With the paper's gains the vars of a returning inverter then ring
for a second. So an agent keeps to the middle half of the period between two measurements, as an inverter's controller
keeps clear of its own sampling.
"""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.hearing import Hearing, OpenMeeting
from gridpeers.agents.session_health import SessionHealth
from gridpeers.wire.journal import TimedTraffic
from gridpeers.wire.links import REPORT_TICKS
from gridpeers.wire.messages import PLANT, Measurement, Prepare, State, Waiting
from gridpeers.wire.node import CLOCK_ALONE
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post
from gridpeers.wire.tick_policy import WAIT, TickVerdict
from gridpeers.wire.timing import Awaited, Timer

EARLIEST, LATEST = 0.25, 0.75

CONVINCED = 5
"""Measurements in a row that come at a bad time before the ticks are moved: one may just have been late."""


class TickTimer(Timer):
    """Due times of an agent's ticks; unless it `keeps_clear` of the measurements, they drift as the own clock does."""

    def __init__(self, period: float, *, keeps_clear: bool = True) -> None:
        self._keeps_clear = keeps_clear
        super().__init__(period, 0.0)
        self.start(0.0)

    def start(self, now: float) -> None:
        """Begin anew, with a tick at once; the first measurement is believed."""
        self._start, self._n = now, 0
        self._measured: float | None = None
        self._astride = CONVINCED - 1

    def measured(self, at: float) -> None:
        self._measured = at

    def take(self, now: float) -> int:
        skipped = super().take(now)
        if self._measured is None or not self._keeps_clear:
            return skipped
        phase = (self.due - self._measured) / self.period % 1.0
        self._measured = None
        self._astride = 0 if EARLIEST <= phase <= LATEST else self._astride + 1
        if self._astride >= CONVINCED:
            self._astride = 0
            self._start += (0.5 - phase) * self.period
        return skipped


LINKS_PERIOD = 0.5
"""Time (s, wall) between two reports on links beside a journal: a record loses no more when a process is killed."""

LEAVING = 1.0
"""Longest wait (s, wall) for the plant's word that it has taken the inverter off: a session that closes at once can
take what was sent last with it."""


class AgentTimer:
    """A tick policy (`gridpeers.wire.tick_policy`): a timer of the agent's own."""

    messages_needed, awaits_states = CLOCK_ALONE, False

    def __init__(
        self,
        config: AgentConfig,
        post: Post,
        phases: Phases,
        heard: Hearing,
        meeting: OpenMeeting,
        timed: TimedTraffic | None,
    ) -> None:
        if config.speed <= 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        self.config, self.post, self.phases, self.heard = config, post, phases, heard
        self.meeting, self.health, self._timed = meeting, SessionHealth(config.name), timed
        # a clock that is to drift must drift
        self._ticks = TickTimer(config.T_c / config.speed / config.clock_rate, keeps_clear=config.clock_rate == 1.0)
        self._report_ticks = REPORT_TICKS if timed is None else max(1, round(LINKS_PERIOD / self._ticks.period))
        self.ticks = self.missed = self.sent = 0
        """Ticks done and left out; states sent, which is the number of the next."""
        self.lost = 0
        """Messages that did not come off the wire, as the numbers of those that did show."""
        self.lateness = 0.0
        """Longest delay of a tick behind its time since the last status (s of wall time)."""
        self.at = 0.0
        """Time of the last tick on the own clock (s of run time)."""
        self._give_up: float | None = None
        self.plant_seen = self._leaving = False
        self._left = self._skipped = 0
        self.forget()

    def forget(self) -> None:
        """Begin anew, with another session."""
        self.run_time = 0.0
        """Run time of the last measurement that came off the wire (s)."""
        self.missing_agents: tuple[str, ...] = ()
        """Agents for which the plant waits."""
        self.used: tuple[str, ...] = ()
        """Neighbours whose states entered the last tick."""
        self.reports = False

    @property
    def deadline(self) -> float:
        return self._ticks.due

    @property
    def t(self) -> float:
        """Run time (s) of the own measurement."""
        return self.heard.t

    def start(self, now: float) -> None:
        self._ticks.start(now)
        if self.config.deadline > 0.0 and not self.plant_seen:
            self._give_up = now + self.config.deadline

    def plant_came(self, now: float) -> None:
        self.plant_seen, self._give_up = True, None
        self.health.plant_seen(now)

    def plant_waits(self, message: Waiting | Prepare, now: float) -> None:
        self.health.plant_seen(now)
        if isinstance(message, Waiting):
            self.missing_agents = message.waits_for

    def gone(self, name: str) -> TickVerdict:
        """Note that a process is gone."""
        if name == PLANT:
            return TickVerdict("wait", "the plant is gone; holds, and seeks it again")
        self.heard.states.pop(name, None)
        self.health.forget(name)
        return WAIT

    def leave(self, now: float) -> None:
        self._leaving = True

    def due(self, now: float) -> None:
        """No message makes a tick due."""

    def granted(self, message: Measurement, now: float) -> bool:
        """Note a measurement off the wire, for the next tick; RejectedError if a later one has come."""
        self.lost += self.post.admission.take(message)
        self.health.came(PLANT, now)
        self._ticks.measured(now)
        self.run_time, self.missing_agents = message.t, ()
        return False

    def counts(self, state: State, now: float) -> bool:
        """Whether a state off the wire enters a tick; RejectedError if a later one has come."""
        self.lost += max(0, self.post.admission.take(state) - state.skipped)
        self.health.came(state.sender, now)
        # The plant sends its commands to links before a measurement: till then no link is known.
        return self.heard.links is None or self.health.has_come(PLANT)

    def missing(self) -> tuple[Awaited, ...]:
        """Nothing: a tick does without what has not come."""
        return ()

    def passed(self, now: float, unmet: tuple[Awaited, ...] = ()) -> TickVerdict:
        late = now - self._ticks.due
        skipped = self._ticks.take(now)
        self.at = now * self.config.speed
        if self._leaving:
            self._left += 1
            return TickVerdict("over") if self._left * self._ticks.period >= LEAVING else WAIT
        config = self.config
        if self._give_up is not None and now >= self._give_up:
            return TickVerdict("break", f"{config.name}: no plant of run {config.run} within {config.deadline:g} s")
        if self.phases.now != "running":
            return TickVerdict("tick")
        self.missed += skipped
        self.lateness = max(self.lateness, late)
        too_late = late * config.speed > config.max_age
        return TickVerdict("tick", f"woken {late:.2f} s late; waits for news" if too_late else "")

    def decide(
        self, agent: Agent, measurement: Measurement | None, decisions: DecisionJournal | None, now: float
    ) -> State | None:
        """Compute a tick with the states that are not too old; None without a measurement, or if the law has failed."""
        self.reports = False
        if measurement is None or agent.fault:
            return None
        heard, neighbours = self.heard, self.meeting.neighbours
        at = self.at
        limit = self.config.control.degraded_communication.max_age or self.config.max_age
        ages = {name: age for name in neighbours if (age := heard.age(name, at)) <= limit}
        before = agent.set_points
        state = replace(agent.tick(measurement, tuple(ages), ages), seq=self.sent)
        if decisions is not None and self._timed is not None:
            all_ages = {name: heard.age(name, at) for name in neighbours}
            decisions.realtime_tick(state.seq, measurement.seq, all_ages, limit, self._timed.now, before)
        self.used = tuple(name for name in ages if agent.shares_island(name))
        self.ticks += 1
        self.sent += 1
        self.reports = self.ticks % self._report_ticks == 0
        if state.fault:
            self.post.say(f"{state.fault}; idle, its inverter stays on primary droop")
        if state.quiet:
            self._skipped += 1
        elif self._skipped:
            state, self._skipped = replace(state, skipped=self._skipped), 0
        return state
