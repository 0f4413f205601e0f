"""When an agent ticks in real time: on its own timer, with what it heard last. Pure.

Nobody grants a tick. At each one the agent uses

- its *measurement*, if it is not older than `max_age`; else it is on hold, and sends nothing to its neighbours;
- the last state of each *neighbour* whose token is there, whose value is not older than `max_age`, and who is in the
  same island. The age is that on the own clock; but a state that was long on its way is as old as its run time says,
  beside that of the own measurement.

Ages are s of run time. Tokens say who exists, never who works: a frozen process keeps its token for seconds.

**A late tick** is done at once, and the ticks missed meanwhile are left out: the schedule does not move. If it is late
by more than `max_age` (the process was frozen, or starved), the agent forgets its neighbours' states, holds its
set-points and waits for new messages. Nobody waits for it: its neighbours continue without its state.

The worst time to tick is just as the next measurement comes, now before it and now after: the set-points then miss the
plant's step, so that the loop is one period longer. With the paper's gains the vars of a returning inverter then ring
for a second. So an agent keeps to the middle half of the period between two measurements, as an inverter's controller
keeps clear of its own sampling.
"""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_reports import AgentReports
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.hearing import Hearing, OpenMeeting
from gridpeers.agents.upkeep import Upkeep
from gridpeers.wire.journal import Traffic
from gridpeers.wire.links import REPORT_TICKS
from gridpeers.wire.messages import PLANT, Leave, Measurement, Prepare, State, Stop, Waiting
from gridpeers.wire.node import CLOCK_ALONE
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post
from gridpeers.wire.tick_policy import WAIT, TickVerdict
from gridpeers.wire.timing import Awaited, Timer

EARLIEST, LATEST = 0.25, 0.75

CONVINCED = 5  # Number of badly timed measurements in a row before the ticks are moved: a single one may be late


class TickTimer(Timer):
    """Due times of an agent's ticks. With `keeps_clear` they avoid the measurements; else they drift with the clock."""

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
"""Time (s, real time) between two reports on links beside a journal, so that a killed process loses little."""

LEAVING = 1.0
"""Longest wait (s, real time) for the plant's confirmation that the inverter is off: a session that closes at once can
lose its last messages."""


class AgentTimer:
    """A tick policy (`gridpeers.wire.tick_policy`): a timer of the agent's own."""

    grants, awaits_states, messages_needed = False, False, CLOCK_ALONE
    control_messages = Waiting, Stop

    def __init__(
        self,
        config: AgentConfig,
        post: Post,
        phases: Phases,
        heard: Hearing,
        meeting: OpenMeeting,
        reports: AgentReports,
        timed: Traffic | None,
    ) -> None:
        if config.speed <= 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        self._config, self._post, self._phases, self._heard = config, post, phases, heard
        self.meeting, self._reports, self._timed = meeting, reports, timed
        self.upkeep = Upkeep(config.run, post, phases, heard, meeting, reports)
        keys, name = post.keys, post.name
        self.publications = keys.set_points(name), keys.leave(name), keys.status(name), keys.link_acknowledgement(name)
        self.quiet_key = keys.set_points(name)
        # a clock that is to drift must drift
        self._ticks = TickTimer(config.T_c / config.speed / config.clock_rate, keeps_clear=config.clock_rate == 1.0)
        self._report_ticks = REPORT_TICKS if timed is None else max(1, round(LINKS_PERIOD / self._ticks.period))
        self.at = 0.0
        """Time of the last measurement or tick on the own clock (s of run time)."""
        self._give_up: float | None = None
        self.plant_seen = self._leaving = False
        self._accounts_due = self._ran = False
        self._left = self._skipped = 0
        self._shown = self.upkeep.shown

    @property
    def deadline(self) -> float:
        return self._ticks.due

    @property
    def t(self) -> float:
        """Run time (s) of the own measurement."""
        return self._heard.t

    def start(self, now: float) -> None:
        self._ticks.start(now)
        self.upkeep.start(now)
        if self._config.deadline > 0.0 and not self.plant_seen:
            self._give_up = now + self._config.deadline

    def plant_came(self, now: float) -> None:
        if self._phases.now == "seeking":
            self._post.say("the plant is there; waits for its first measurement")
        self.plant_seen, self._give_up = True, None
        self.upkeep.health.plant_seen(now)

    def plant_waits(self, message: Waiting | Prepare, now: float) -> None:
        self.upkeep.health.plant_seen(now)
        if isinstance(message, Waiting):
            self.upkeep.missing_agents = message.waits_for

    def new_plant(self) -> None:
        self.hold("the plant restarted; continues from its measurement")
        self._ran = False
        self.upkeep.new_plant()

    def new_session(self) -> None:
        """Forget all messages of the old session."""
        self.meeting.clear()
        self._heard.clear()
        self.upkeep.new_session()

    def gone(self, name: str) -> TickVerdict:
        """Note that a process is gone."""
        if name == PLANT:
            return TickVerdict("wait", "the plant is gone; holds its set-points and looks for it")
        self._heard.states.pop(name, None)
        self.upkeep.health.forget(name)
        return WAIT

    def hold(self, why: str) -> None:
        """Forget all states; the next measurement has the set-points to start from."""
        if self._phases.now == "running":
            self._phases.on("held")
            self._post.say(why)
        self.upkeep.used = ()
        self._heard.clear()
        self._heard.agent.restart()

    def joined(self, measurement: Measurement) -> None:
        joins, P_set, V_set = "goes on" if self._ran else "joins", measurement.P_set, measurement.V_set
        self._post.say(f"{joins} at t = {measurement.t:.2f} s, from {P_set:.0f} W and {V_set:.1f} V")
        self._ran = True

    def leave(self, now: float) -> bool:
        """Send a Leave; return whether there is a plant, which takes the inverter off the network."""
        post, self._leaving = self._post, True
        self._reports.last(self.t)
        post.send(post.keys.leave(post.name), Leave(sender=post.name, epoch=post.epoch, seq=self.upkeep.sent, t=self.t))
        return post.plant is not None and bool(post.plant.present)

    def run_time(self, t: float, now: float) -> float:
        """Return the time on the own clock (s of run time)."""
        return now * self._config.speed

    def due(self, now: float) -> None:
        """No message makes a tick due."""

    def granted(self, message: Measurement, now: float) -> bool:
        """Note a measurement off the wire, for the next tick; RejectedError if a later one has come."""
        upkeep = self.upkeep
        upkeep.lost += self._post.admission.take(message)
        upkeep.health.came(PLANT, now)
        self._ticks.measured(now)
        self.at, upkeep.run_time, upkeep.missing_agents = self.run_time(message.t, now), message.t, ()
        return False

    def counts(self, state: State, now: float) -> bool:
        """Whether a state off the wire enters a tick; RejectedError if a later one has come."""
        health = self.upkeep.health
        self.upkeep.lost += max(0, self._post.admission.take(state) - state.skipped)
        health.came(state.sender, now)
        # The plant sends its commands to links before a measurement: till then no link is known.
        return self._heard.links is None or health.has_come(PLANT)

    def missing(self) -> tuple[Awaited, ...]:
        """Return nothing: a tick does not wait for messages."""
        return ()

    def passed(self, now: float, unmet: tuple[Awaited, ...] = ()) -> TickVerdict:
        late = now - self._ticks.due
        skipped = self._ticks.take(now)
        self.at = now * self._config.speed
        if self._leaving:
            self._left += 1
            return TickVerdict("over") if self._left * self._ticks.period >= LEAVING else WAIT
        config = self._config
        if self._give_up is not None and now >= self._give_up:
            return TickVerdict("break", f"{config.name}: no plant of run {config.run} within {config.deadline:g} s")
        if self._phases.now == "running":
            self.upkeep.missed += skipped
            self.upkeep.lateness = max(self.upkeep.lateness, late)
            if late * config.speed > config.max_age:
                self.hold(f"woke {late:.2f} s late; waits for new messages")
        self._shown = self.upkeep.shown
        return TickVerdict("tick")

    def decide(
        self, agent: Agent, measurement: Measurement | None, decisions: DecisionJournal | None, now: float
    ) -> State | None:
        """Compute a tick with the states that are not too old; None without a measurement, or if the law has failed."""
        if measurement is None or agent.fault:
            return None
        heard, neighbours, upkeep, at = self._heard, self.meeting.neighbours, self.upkeep, self.at
        limit = (self._config.control.degraded_communication.max_age or self._config.max_age) + 1e-9
        ages = {name: age for name in neighbours if (age := heard.age(name, at)) <= limit}
        before = agent.set_points
        state = replace(agent.tick(measurement, tuple(ages), ages), seq=upkeep.sent)
        if decisions is not None and self._timed is not None:
            all_ages = {name: heard.age(name, at) for name in neighbours}
            decisions.realtime_tick(state.seq, measurement.seq, all_ages, limit, now, before)
        upkeep.used = tuple(name for name in ages if agent.shares_island(name))
        upkeep.ticks += 1
        upkeep.sent += 1
        self._accounts_due = upkeep.ticks % self._report_ticks == 0
        if state.fault:
            self._post.say(f"{state.fault}; idle, its inverter stays on primary droop")
        if state.quiet:
            self._skipped += 1
        elif self._skipped:
            state, self._skipped = replace(state, skipped=self._skipped), 0
        return state

    def ticked(self, now: float) -> bool:
        """Report what is due; return whether a new session is needed."""
        if self._accounts_due:
            self._accounts_due = False
            self._reports.links()
        return self.upkeep.ticked(self._shown, self.at, now)
