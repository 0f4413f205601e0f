"""What an agent does in real time beside its ticks: it reports, judges its session, takes commands to links. Pure."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Literal, cast

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.link_command_receiver import LinkCommandReceiver
from gridpeers.agents.neighbours import Hearing, OpenMeeting
from gridpeers.agents.session_health import SessionHealth
from gridpeers.agents.tick_timer import AgentTimer
from gridpeers.wire.links import Links
from gridpeers.wire.messages import MOST_COUNT, PLANT, AgentStatus, Leave, LinkRequest
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post
from gridpeers.wire.timing import Timer
from gridpeers.wire.wording import printable

STATUS_PERIOD = 0.5
"""Time (s, wall) between two `AgentStatus`; one more goes out whenever the phase or the neighbours in use change."""

JOURNAL_PERIOD = 0.2
"""Time (s, wall) between two parts of the journal: a record loses no more when a process is killed."""


class Upkeep:
    def __init__(
        self,
        post: Post,
        phases: Phases,
        heard: Hearing,
        meeting: OpenMeeting,
        timer: AgentTimer,
        health: SessionHealth,
        links: Links | None,
    ) -> None:
        self._post, self._phases, self._heard, self._meeting = post, phases, heard, meeting
        self._timer, self._health = timer, health
        self._link_commands = LinkCommandReceiver(post.name, post.epoch, links)
        self.host_moved: Callable[[], bool] = lambda: False
        """Whether the own host has another address than the session knows; the driver sets it."""
        self.start(0.0)

    def start(self, now: float) -> None:
        self._status, self._journal = Timer(STATUS_PERIOD, now), Timer(JOURNAL_PERIOD, now)

    def new_session(self) -> None:
        """Forget all that came by the old session."""
        self._health.next_session()
        self._meeting.clear()
        self._heard.clear()
        self._timer.forget()

    def hold(self) -> None:
        self._timer.used = ()
        self._heard.clear()

    def leave(self) -> None:
        post = self._post
        leave = Leave(sender=post.name, epoch=post.epoch, seq=self._timer.statistics.sent, t=self._heard.t)
        post.send(post.keys.leave(post.name), leave)

    def change(self, config: AgentConfig, agent: Agent) -> None:
        self._timer.config, self._heard.agent, self._meeting.agent = config, agent, agent
        self._meeting.listen()

    def new_plant(self) -> None:
        self._link_commands.restart()
        self._health.forget(PLANT)

    def on_link_command(self, request: LinkRequest, payload: bytes, now: float) -> None:
        answer = self._link_commands.take(request, self._timer.run_time)
        if answer is not None:
            self._post.send(self._post.keys.link_acknowledgement(self._post.name), answer)

    @property
    def shown(self) -> tuple[str, tuple[str, ...]]:
        """The part of the status whose change is reported at once."""
        return self._phases.now, self._timer.used

    def journal_due(self, now: float) -> bool:
        if now < self._journal.due or self._phases.now != "running":  # running: the plant knows this process
            return False
        self._journal.take(now)
        return True

    def session_problem(self, failed: bool, now: float) -> str:
        """Return why a new session is needed, "" if it is not: this one did not bring, or take, what it should.

        `failed`: whether the agent's law has failed.
        """
        if self.host_moved():
            return "this host has another address"
        measured = self._heard.measurement if self._phases.now == "running" else None
        roster = None if measured is None else measured.roster
        if roster is not None and failed:
            roster = (*roster, self._post.name)  # who says nothing is not heard, and no session changes that
        met = self._post.members.nameplates
        return self._health.problem(roster, met=met, neighbours=self._meeting.neighbours, now=now)

    def report(self, shown: tuple[str, tuple[str, ...]], now: float, at: float) -> None:
        """Publish the status if it is due, or if not the same is `shown` as before; ask again for nameplates.

        `at` is the run time (s) on the own clock.
        """
        due = now >= self._status.due
        if due:
            self._status.take(now)
            self._post.ask_again()
        if due or self.shown != shown:
            self._publish_status(at)

    def _publish_status(self, at: float) -> None:
        post, timer, heard, neighbours = self._post, self._timer, self._heard, self._meeting.neighbours
        statistics, phase, run = timer.statistics, self._phases.now, timer.config.run
        missing = f", which waits for {', '.join(timer.missing_agents)}" if timer.missing_agents else ""
        waits_for = {
            "seeking": f"the plant of run {run}",
            "waiting": f"a measurement of {post.name} from the plant{missing}",
        }
        links = heard.links
        dropped = 0 if links is None else links.dropped
        ages = [heard.age(name, at) for name in neighbours]
        status = AgentStatus(
            sender=post.name,
            epoch=post.epoch,
            seq=statistics.sent,
            t=heard.t,
            phase=cast(Literal["seeking", "waiting", "running"], phase),
            waits_for=printable(waits_for.get(phase, "")),
            island="" if heard.measurement is None else heard.measurement.island,
            neighbours=neighbours,
            ages=tuple(age if age < inf else -1.0 for age in ages),
            used=timer.used,
            received=post.used,
            sent=statistics.sent,
            rejected=sum(post.rejects.counts.values()),
            lost=min(statistics.lost + dropped, MOST_COUNT),
            ticks=statistics.ticks,
            missed=statistics.missed,
            lateness=statistics.lateness,
            impaired=() if links is None else links.impaired(timer.run_time),
        )
        statistics.lateness = 0.0
        post.send(post.keys.status(post.name), status)
