"""What an agent does in real time beside its ticks: it reports, judges its session, takes commands to links. Pure."""

from __future__ import annotations

from math import inf
from typing import Literal, cast

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.tick_timer import AgentTimer
from gridpeers.wire.links import Links
from gridpeers.wire.messages import MOST_COUNT, PLANT, AgentStatus, Leave, LinkAcknowledgement, LinkRequest
from gridpeers.wire.timing import Timer
from gridpeers.wire.wording import printable

STATUS_PERIOD = 0.5
"""Time (s, wall) between two `AgentStatus`; one more goes out whenever the phase or the neighbours in use change."""

JOURNAL_PERIOD = 0.2
"""Time (s) between two parts of the journal, in simulated time only with emulated links: a kill loses no more."""


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
        """Carry a command out, or tell the links' status at t (s of run time); None if an earlier one is missing."""
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
    def __init__(self, timer: AgentTimer, links: Links | None) -> None:
        self._timer, self._health, self._heard, self._meeting = timer, timer.health, timer.heard, timer.meeting
        post = self._post = timer.post
        self._link_commands = LinkCommandReceiver(post.name, post.epoch, links)
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
        leave = Leave(sender=post.name, epoch=post.epoch, seq=self._timer.sent, t=self._heard.t)
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
        return self._timer.phases.now, self._timer.used

    def ticked(self, shown: tuple[str, tuple[str, ...]], failed: bool, now: float) -> bool:
        """Do what is due after a tick; return whether a new session is needed.

        `shown` is the part of the status before the tick; `failed` says whether the agent's law has failed.
        """
        post, running = self._post, self._timer.phases.now == "running"
        if now >= self._journal.due and running:  # then the plant knows this process
            self._journal.take(now)
            post.send(post.keys.journal(post.name), *post.take_journal(self._heard.t))
        problem = self._session_problem(failed, now)
        if problem:
            post.say(f"{problem}; opens a new session")
        due = now >= self._status.due
        if due:
            self._status.take(now)
            post.ask_again()
        if due or self.shown != shown:
            self._publish_status()
        return bool(problem)

    def _session_problem(self, failed: bool, now: float) -> str:
        """Return why a new session is needed, "" if it is not: this one did not bring, or take, what it should."""
        measured = self._heard.measurement if self._timer.phases.now == "running" else None
        roster = None if measured is None else measured.roster
        if roster is not None and failed:
            roster = (*roster, self._post.name)  # who says nothing is not heard, and no session changes that
        met = self._post.members.nameplates
        return self._health.problem(roster, met=met, neighbours=self._meeting.neighbours, now=now)

    def _publish_status(self) -> None:
        post, timer, heard, neighbours = self._post, self._timer, self._heard, self._meeting.neighbours
        phase, run = timer.phases.now, timer.config.run
        missing = f", which waits for {', '.join(timer.missing_agents)}" if timer.missing_agents else ""
        waits_for = {
            "seeking": f"the plant of run {run}",
            "waiting": f"a measurement of {post.name} from the plant{missing}",
        }
        links = heard.links
        dropped = 0 if links is None else links.dropped
        ages = [heard.age(name, timer.at) for name in neighbours]
        status = AgentStatus(
            sender=post.name,
            epoch=post.epoch,
            seq=timer.sent,
            t=heard.t,
            phase=cast(Literal["seeking", "waiting", "running"], phase),
            waits_for=printable(waits_for.get(phase, "")),
            island="" if heard.measurement is None else heard.measurement.island,
            neighbours=neighbours,
            ages=tuple(age if age < inf else -1.0 for age in ages),
            used=timer.used,
            received=post.used,
            sent=timer.sent,
            rejected=sum(post.rejects.counts.values()),
            lost=min(timer.lost + dropped, MOST_COUNT),
            ticks=timer.ticks,
            missed=timer.missed,
            lateness=timer.lateness,
            impaired=() if links is None else links.impaired(timer.run_time),
        )
        timer.lateness = 0.0
        post.send(post.keys.status(post.name), status)
