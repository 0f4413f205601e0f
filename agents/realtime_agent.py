"""An agent under real time: it ticks on its own timer, with what it heard last. Pure.

Nobody grants a tick. At each one the agent uses

- its *measurement*, if it is not older than `max_age`; else it is on hold, and sends nothing to its neighbours;
- the last state of each *neighbour* whose token is there, whose value is not older than `max_age`, and who is in the
  same island. The age is that on the own clock; but a state that was long on its way is as old as its run time says,
  beside that of the own measurement.

Ages are s of run time. Tokens say who exists, never who works: a frozen process keeps its token for seconds.

**Phases.** *seeking*: there is no plant. *waiting*: the plant is there, but has sent no measurement recently.
*running*: the agent ticks. Whoever comes back to *running* starts from the set-points that its measurement shows: those
the plant holds for it. An agent that finds itself woken late (frozen, or starved) drops what it knew and waits for
news.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Literal

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.laws.law import Law
from gridpeers.agents.link_command_receiver import LinkCommandReceiver
from gridpeers.agents.session_health import SessionHealth
from gridpeers.agents.tick_timer import TickTimer
from gridpeers.wire.codec import encode
from gridpeers.wire.journal import JournalBuffer, TimedTraffic
from gridpeers.wire.links import REPORT_TICKS, Links
from gridpeers.wire.messages import (
    MOST_COUNT,
    PLANT,
    AgentStatus,
    Leave,
    LinkRequest,
    Measurement,
    Nameplate,
    State,
    Stop,
    Waiting,
)
from gridpeers.wire.node import CLOCK_ALONE
from gridpeers.wire.post import Route
from gridpeers.wire.timing import Timer
from gridpeers.wire.wording import printable

Phase = Literal["seeking", "waiting", "running"]


STATUS_PERIOD = 0.5
"""Time (s, wall) between two `AgentStatus`; one more goes out whenever the phase or the neighbours in use change."""

JOURNAL_PERIOD, LINKS_PERIOD = 0.2, 0.5
"""Time (s, wall) between two parts of the journal, and between two reports on links beside it: a record loses no more
when a process is killed."""

LEAVING = 1.0
"""Longest wait (s, wall) for the plant's word that it has taken the inverter off: a session that closes at once can
take what was sent last with it."""


@dataclass
class AgentStatistics:
    ticks: int = 0
    missed: int = 0
    sent: int = 0
    """States sent; the number of the next."""
    lost: int = 0
    """Messages that did not come off the wire, as the numbers of those that did show."""
    lateness: float = 0.0
    """Longest delay of a tick behind its time since the last status (s of wall time)."""


class RealtimeAgent(AgentNode):
    """One agent under real time, on one session after the other if need be; parameters as of `AgentNode`."""

    def __init__(self, config: AgentConfig, instance: str, links: Links | None = None, law: Law | None = None) -> None:
        if config.speed <= 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        super().__init__(config, instance, links, law)
        self.routes[self.keys.control] = Route(PLANT, (Waiting, Stop), self._on_control)
        self.routes[self.keys.link_request(config.name)] = Route(PLANT, (LinkRequest,), self._on_link_command)
        self._first_routes = dict(self.routes)
        self._timed: TimedTraffic | None = None
        if config.record != "physics":
            journal = self.post.journal = JournalBuffer()
            self._timed = self.post.traffic = TimedTraffic(self.keys, journal, arrivals=config.record == "all")
            self._decisions = DecisionJournal(self._agent, journal)
        self._journal_timer = Timer(JOURNAL_PERIOD, 0.0)
        self.phase: Phase = "seeking"
        self.statistics = AgentStatistics()
        self._plant_epoch = 0
        self._link_commands = LinkCommandReceiver(config.name, config.epoch, links)
        # a clock that is to drift must drift
        self._timer = TickTimer(config.T_c / config.speed / config.clock_rate, keeps_clear=config.clock_rate == 1.0)
        recorded = self.post.journal is not None
        self._report_ticks = max(1, round(LINKS_PERIOD / self._timer.period)) if recorded else REPORT_TICKS
        self._status = Timer(STATUS_PERIOD, 0.0)
        self._give_up: float | None = None
        self._health = SessionHealth(config.name)
        self._leaving = ""
        self._ran = False
        self._left = 0
        self._skipped = 0
        self.host_moved: Callable[[], bool] = lambda: False
        """Whether the own host has another address than the session knows; the driver sets it."""
        self._forget_everybody()

    def _forget_everybody(self) -> None:
        self.phase = "seeking"
        self.routes.clear()
        self.routes.update(self._first_routes)
        self.plant.present.clear()
        self.admission.release(PLANT)
        for name in self.members.nameplates:
            self._agent.forget(name)
        self.members.clear()
        self.states.clear()
        self._missing_agents: tuple[str, ...] = ()
        self._run_time = 0.0
        """Run time of the last measurement that came off the wire (s)."""
        self._neighbours: tuple[str, ...] = ()
        self._used_neighbours: tuple[str, ...] = ()

    @property
    def publications(self) -> tuple[str, ...]:
        keys, name = self.keys, self.name
        own = keys.state, keys.set_points, keys.leave, keys.status, keys.report, keys.link_acknowledgement, keys.journal
        return tuple(key(name) for key in own)

    @property
    def finished(self) -> bool:
        return super().finished or self.session_broken

    @property
    def messages_needed(self) -> int:
        return CLOCK_ALONE

    @property
    def deadline(self) -> float:
        return self._timer.due

    def start(self, now: float) -> None:
        """Begin to tick, or begin again after a broken session; there is nothing to do yet."""
        self._timer.start(now)
        self._status = Timer(STATUS_PERIOD, now)
        self._journal_timer = Timer(JOURNAL_PERIOD, now)
        if self._timed is not None:
            self._timed.process("session" if self.session_broken else "start", f"instance {self._instance}", now)
        if self._config.deadline > 0.0:
            self._give_up = now + self._config.deadline
        if self.session_broken:
            self.session_broken = False
            self._health.next_session()
            self._agent.restart()
            self._forget_everybody()

    def expire(self, now: float) -> None:
        late = now - self._timer.due
        if late < 0.0 or self.finished:
            return
        if self._timed is not None:
            self._timed.woken(now)
        skipped = self._timer.take(now)
        if self._leaving:
            self._left += 1
            if self._left * self._timer.period >= LEAVING or not self.plant.present:
                self.stopped = self._leaving
            return
        if self._give_up is not None and not self.plant_seen and now >= self._give_up:
            self.failed = f"{self.name}: no plant of run {self._config.run} within {self._config.deadline:g} s"
            return
        if self.phase == "running":
            self.statistics.missed += skipped
            self.statistics.lateness = max(self.statistics.lateness, late)
            if late * self._config.speed > self._config.max_age:
                self._hold(f"woken {late:.2f} s late; waits for news")
        at = now * self._config.speed
        self._hear_late(at)
        before = self.phase, self._used_neighbours
        self._tick(at)
        if now >= self._journal_timer.due and self.phase == "running":  # then the plant knows this process
            self._journal_timer.take(now)
            self._report_journal()
        self._check_session(now)
        due = now >= self._status.due
        if due:
            self._status.take(now)
            self.post.ask_again()
        if due or (self.phase, self._used_neighbours) != before:
            self._publish_status(at)

    def _check_session(self, now: float) -> None:
        """Ask for a new session if this one has not brought what it should, or not taken it, for too long."""
        measured = self.states.measurement if self.phase == "running" else None
        roster = None if measured is None else measured.roster
        if roster is not None and self._agent.fault:
            roster = (*roster, self.name)  # who says nothing is not heard, and no session changes that
        met, moved = self.members.nameplates, "this host has another address" if self.host_moved() else ""
        if problem := moved or self._health.problem(roster, met=met, neighbours=self._neighbours, now=now):
            self.session_broken = True
            self.post.say(f"{problem}; opens a new session")

    def leave(self, reason: str) -> None:
        """Leave properly: have the own inverter taken off the network, and close once the plant says that it is."""
        if self.finished or self._leaving:
            return
        self._report_journal()
        self._report_links(final=True)
        name, epoch = self.name, self._config.epoch
        message = Leave(sender=name, epoch=epoch, seq=self.statistics.sent, t=self.states.t)
        self.post.publish(self.keys.leave(name), encode(message))
        if self.plant.present:
            self._leaving = reason
        else:
            self.stopped = reason

    def asked_to_leave(self, reason: str) -> None:
        """Leave, as somebody outside of the run asks for it, and note that: a replay must do the same."""
        if self._timed is not None and not (self.finished or self._leaving):
            self._timed.process("leave", reason, self._timed.now)
        self.leave(reason)

    def change(self, config: AgentConfig, law: Law | None = None) -> None:
        """Go on under another rule of control, with the set-points of now; see `Agent.taken_over`."""
        self._config, self._agent = config, self._agent.taken_over(config, law)
        if self.post.journal is not None:
            self._decisions = DecisionJournal(self._agent, self.post.journal)
        self._listen()

    def _plant_came(self, now: float) -> None:
        self._health.plant_seen(now)
        if self.phase == "seeking":
            self.phase = "waiting"
            self.post.say("the plant is there; waits for its measurement")

    def _plant_gone(self, now: float) -> None:
        self._hold("the plant is gone; holds, and seeks it again")
        self.phase = "waiting" if self.plant.present else "seeking"

    def _agent_gone(self, name: str, instance: str, now: float) -> None:
        self._agent.forget(name)
        self.states.forget(name)
        self._health.forget(name)
        if name in self.members.nameplates:  # another process counts from now on, and has answered
            self._agent.meet(self.members.nameplates[name])
        self._listen()

    def _on_nameplate(self, instance: str, nameplate: Nameplate, first: bool, now: float) -> None:
        if first:
            self._agent.meet(nameplate)
            self._listen()

    def _listen(self) -> None:
        self._neighbours = self._agent.in_neighbours((self.name, *sorted(self.members.nameplates)))
        for name in self._neighbours:
            self._listen_to(name)

    def _follow(self, epoch: int) -> None:
        """Begin anew with another plant; one whose token was gone for a while goes on where it was."""
        if self._plant_epoch not in (0, epoch):
            self._hold("the plant has a new life; starts from what it measures")
            self._ran = False
            self._link_commands.restart()
            self._health.forget(PLANT)
        self._plant_epoch = epoch

    def _on_control(self, message: Waiting | Stop, payload: bytes, now: float) -> None:
        if isinstance(message, Waiting):
            self._health.plant_seen(now)
            self._missing_agents = message.waits_for
        else:
            self._on_stop_request(message, payload, now)

    def _on_stop_request(self, message: Stop, payload: bytes, now: float) -> None:
        if message.refused:
            self.failed = message.reason
        elif self._leaving:
            self.stopped = self._leaving
        else:
            self.leave(message.reason)

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        self.statistics.lost += self.admission.take(message)
        self._health.came(PLANT, now)
        self._timer.measured(now)
        self._run_time, self._missing_agents = message.t, ()
        self._hear(message, payload, now * self._config.speed)

    def _on_state(self, message: State, payload: bytes, now: float) -> None:
        self.statistics.lost += max(0, self.admission.take(message) - message.skipped)
        self._health.came(message.sender, now)
        if self._links is not None and not self._health.has_come(PLANT):
            return  # the plant sends its commands to links before a measurement: till then no link is known
        self._hear(message, payload, now * self._config.speed)

    def _on_link_command(self, message: LinkRequest, payload: bytes, now: float) -> None:
        answer = self._link_commands.take(message, self._run_time)
        if answer is not None:
            self.post.publish(self.keys.link_acknowledgement(self.name), encode(answer))

    def _hold(self, why: str) -> None:
        if self.phase == "running":
            self.phase = "waiting"
            self.post.say(why)
        self._used_neighbours = ()
        self.states.clear()
        self._agent.restart()

    def _tick(self, at: float) -> None:
        """Tick at this time (s of run time on the own clock), if there is a measurement to tick with."""
        if self.admission.epochs.get(PLANT) is None:
            return  # what the dead plant said last would still look fresh
        measurement = self.states.measured(at, self._config.max_age)
        if measurement is None:
            self._hold("no recent measurement; holds")
            return
        if self.phase != "running":
            self.phase = "running"
            m, joins = measurement, "goes on" if self._ran else "joins"
            self.post.say(f"{joins} at t = {m.t:.2f} s, from {m.P_set:.0f} W and {m.V_set:.1f} V")
            self._ran = True
        if self._agent.fault:
            return
        limit = self._config.control.degraded_communication.max_age or self._config.max_age
        ages = {name: age for name in self._neighbours if (age := self.states.age(name, at)) <= limit}
        before = self._agent.set_points
        state = replace(self._agent.tick(measurement, tuple(ages), ages), seq=self.statistics.sent)
        if self._timed is not None:
            all_ages = {name: self.states.age(name, at) for name in self._neighbours}
            self._decisions.realtime_tick(state.seq, measurement.seq, all_ages, limit, self._timed.now, before)
        self._used_neighbours = tuple(name for name in ages if self._agent.shares_island(name))
        self.statistics.ticks += 1
        self.statistics.sent += 1
        if self.statistics.ticks % self._report_ticks == 0:
            self._report_links()
        self._send(state)

    def _report_journal(self) -> None:
        for part in self.post.take_journal(self.states.t):
            self.post.publish(self.keys.journal(self.name), encode(part))

    def _send(self, state: State) -> None:
        """Send a state to everybody, or to the plant alone if the law does not tell the neighbours."""
        if state.fault:
            self.post.say(f"{state.fault}; idle, its inverter stays on primary droop")
        if state.quiet:
            self._skipped += 1
            self.post.publish(self.keys.set_points(self.name), encode(state))
        else:
            state, self._skipped = replace(state, skipped=self._skipped) if self._skipped else state, 0
            self.post.publish(self.keys.state(self.name), encode(state))

    def _publish_status(self, at: float) -> None:
        config, statistics, states = self._config, self.statistics, self.states
        missing = f", which waits for {', '.join(self._missing_agents)}" if self._missing_agents else ""
        waits_for = {
            "seeking": f"the plant of run {config.run}",
            "waiting": f"a measurement of {config.name} from the plant{missing}",
            "running": "",
        }
        dropped = 0 if self._links is None else self._links.dropped
        ages = [states.age(name, at) for name in self._neighbours]
        status = AgentStatus(
            sender=config.name,
            epoch=config.epoch,
            seq=statistics.sent,
            t=states.t,
            phase=self.phase,
            waits_for=printable(waits_for[self.phase]),
            island="" if states.measurement is None else states.measurement.island,
            neighbours=self._neighbours,
            ages=tuple(age if age < inf else -1.0 for age in ages),
            used=self._used_neighbours,
            received=self.post.used,
            sent=statistics.sent,
            rejected=sum(self.rejects.counts.values()),
            lost=min(statistics.lost + dropped, MOST_COUNT),
            ticks=statistics.ticks,
            missed=statistics.missed,
            lateness=statistics.lateness,
            impaired=() if self._links is None else self._links.impaired(self._run_time),
        )
        statistics.lateness = 0.0
        self.post.publish(self.keys.status(self.name), encode(status))
