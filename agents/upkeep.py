"""What an agent does in real time beside its ticks: it reports, judges its session, takes commands to links. Pure."""

from __future__ import annotations

from math import inf
from typing import Literal, cast

from gridpeers.agents.agent_reports import JOURNAL_PERIOD, AgentReports
from gridpeers.agents.hearing import Hearing, OpenMeeting
from gridpeers.agents.session_health import SessionHealth
from gridpeers.wire.links import Links
from gridpeers.wire.messages import MOST_COUNT, PLANT, AgentStatus, LinkAcknowledgement, LinkRequest
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post, Route
from gridpeers.wire.timing import Timer
from gridpeers.wire.wording import printable

STATUS_PERIOD = 0.5
"""Time (s, real time) between two `AgentStatus`; a new phase, or other neighbours in use, send one more."""


class LinkCommandReceiver:
    """Commands to the emulated links into an agent: taken in their sequence, each once, and acknowledged."""

    def __init__(self, name: str, epoch: int, links: Links | None) -> None:
        self._name, self._epoch, self._links = name, epoch, links
        self._last = 0

    def restart(self) -> None:
        """Forget all commands: another plant has begun, whose run starts at 0."""
        self._last = 0
        if self._links is not None:
            self._links.restart()

    def take(self, request: LinkRequest, t: float) -> LinkAcknowledgement | None:
        """Carry a command out, or return the links' status at t (s of run time); None if an earlier one is missing."""
        if self._links is None:
            return self._answer(request, ok=False, text="there are no emulated links to this agent")
        if request.seq == 0:
            return self._answer(request, ok=True, text="", data=self._links.status(t))
        if request.seq > self._last + 1:
            return None
        if request.seq <= self._last:
            return self._answer(request, ok=True, text="done before")
        self._last = request.seq
        try:
            return self._answer(request, ok=True, text=self._links.command(request.link_command, request.t).changed)
        except ValueError as error:
            return self._answer(request, ok=False, text=str(error))

    def _answer(self, request: LinkRequest, *, ok: bool, text: str, data: bytes = b"") -> LinkAcknowledgement:
        return LinkAcknowledgement(
            sender=self._name,
            epoch=self._epoch,
            seq=request.seq,
            t=request.t,
            ok=ok,
            text=printable(text),
            reply_to=request.reply_to,
            data=data,
        )


class Upkeep:
    """Counts for the status of an agent in real time, the health of its session, and commands to its links."""

    def __init__(
        self, run: str, post: Post, phases: Phases, heard: Hearing, meeting: OpenMeeting, reports: AgentReports
    ) -> None:
        self._run, self._post, self._phases, self._heard = run, post, phases, heard
        self._meeting, self._reports = meeting, reports
        self.health = SessionHealth(post.name)
        self._link_commands = LinkCommandReceiver(post.name, post.epoch, heard.links)
        post.routes[post.keys.link_request(post.name)] = Route(PLANT, (LinkRequest,), self.on_link_command)
        self.ticks = self.missed = self.sent = 0
        """Ticks done and left out; states sent, which is the number of the next."""
        self.lost = 0
        """Lost messages, by the gaps in the numbers of those that arrived."""
        self.lateness = 0.0
        """Longest delay of a tick behind its time since the last status (s of real time)."""
        self.start(0.0)
        self._forget()

    def _forget(self) -> None:
        self.run_time = 0.0
        """Run time of the last measurement that came off the wire (s)."""
        self.missing_agents: tuple[str, ...] = ()
        """Agents for which the plant waits."""
        self.used: tuple[str, ...] = ()
        """Neighbours whose states entered the last tick."""

    def start(self, now: float) -> None:
        self._status, self._journal = Timer(STATUS_PERIOD, now), Timer(JOURNAL_PERIOD, now)

    def new_session(self) -> None:
        self.health.next_session()
        self._forget()

    def new_plant(self) -> None:
        self._link_commands.restart()
        self.health.forget(PLANT)

    def on_link_command(self, request: LinkRequest, payload: bytes, now: float) -> None:
        answer = self._link_commands.take(request, self.run_time)
        if answer is not None:
            self._post.send(self._post.keys.link_acknowledgement(self._post.name), answer)

    @property
    def shown(self) -> tuple[str, tuple[str, ...]]:
        """The part of the status whose change is reported at once."""
        return self._phases.now, self.used

    def ticked(self, shown: tuple[str, tuple[str, ...]], at: float, now: float) -> bool:
        """Do what is due after a tick; return whether a new session is needed.

        `shown` is the part of the status before the tick; `at` its time on the own clock (s of run time).
        """
        post = self._post
        if now >= self._journal.due and self._phases.now == "running":  # then the plant knows this process
            self._journal.take(now)
            self._reports.journal(self._heard.t)
        problem = self._session_problem(now)
        if problem:
            post.say(f"{problem}; opens a new session")
        due = now >= self._status.due
        if due:
            self._status.take(now)
            post.ask_again()
        if due or self.shown != shown:
            self._publish_status(at)
        return bool(problem)

    def _session_problem(self, now: float) -> str:
        """Return why a new session is needed, or "": this session did not deliver its messages."""
        measured = self._heard.measurement if self._phases.now == "running" else None
        roster = None if measured is None else measured.roster
        if roster is not None and self._heard.agent.fault:
            roster = (*roster, self._post.name)  # who says nothing is not heard, and no session changes that
        met = self._post.members.nameplates
        return self.health.problem(roster, met=met, neighbours=self._meeting.neighbours, now=now)

    def _publish_status(self, at: float) -> None:
        post, phase, heard, neighbours = self._post, self._phases.now, self._heard, self._meeting.neighbours
        missing = f", which waits for {', '.join(self.missing_agents)}" if self.missing_agents else ""
        waits_for = {
            "seeking": f"the plant of run {self._run}",
            "waiting": f"a measurement of {post.name} from the plant{missing}",
        }
        links = heard.links
        dropped = 0 if links is None else links.dropped
        ages = [heard.age(name, at) for name in neighbours]
        status = AgentStatus(
            sender=post.name,
            epoch=post.epoch,
            seq=self.sent,
            t=heard.t,
            phase=cast(Literal["seeking", "waiting", "running"], phase),
            waits_for=printable(waits_for.get(phase, "")),
            island="" if heard.measurement is None else heard.measurement.island,
            neighbours=neighbours,
            ages=tuple(age if age < inf else -1.0 for age in ages),
            used=self.used,
            received=post.used,
            sent=self.sent,
            rejected=sum(post.rejects.counts.values()),
            lost=min(self.lost + dropped, MOST_COUNT),
            ticks=self.ticks,
            missed=self.missed,
            lateness=self.lateness,
            impaired=() if links is None else links.impaired(self.run_time),
        )
        self.lateness = 0.0
        post.send(post.keys.status(post.name), status)
