"""The agent's side of simulated time, sans-IO: tokens and messages in, actions out.

A driver (`agents.runtime` over Zenoh, `scenarios.drivers.inprocess` on a bus) does, from one thread,

    side.appeared(key, now) | side.vanished(key, now)       a liveliness token came or went
    side.received(key, payload, now)                        a message, or the answer to a `Fetch`
    for action in side.take_actions(): ...                  do it, in this order
    side.expire(now)                                        when `side.until` has passed

until `side.over`, the last actions included. `now` is the driver's clock (s) and serves deadlines only: nothing that is
computed depends on it.

How it finds the others, and when it is ready to tick with them, is written in `introductions`; what it waits for at
each tick, in `turn`.

**No deadlock.** State(k) waits for Measurement(k) and States(k-1) only, Measurement(k) for States(k-1) only: every
wait is for something earlier, so the earliest thing not yet sent always can be, if its sender lives. The token of a
dead process vanishes, which ends the wait for it: its last value counts once more, and the next roster leaves it out.
What neither sends nor dies meets the deadline. The agent's is twice the plant's, so that the plant, who sees all, names
the culprit. Receivers only enqueue, without bound, so nobody blocks a sender.
"""

from __future__ import annotations

from functools import partial

from msgspec.structs import replace

from agents.agent import Agent
from agents.config import AgentConfig
from agents.laws.law import Law
from agents.lockstep.introductions import Ask, Confirm, Hear, Introductions, Peer, Step
from agents.lockstep.turn import Turn
from agents.side import REPORT_TICKS, Side
from wire.actions import Fetch, Listen
from wire.clock import time_of
from wire.codec import RejectedError, encode
from wire.endpoint import Route
from wire.links import Links, arrived, is_usable
from wire.messages import PLANT, AnyMessage, Measurement, Nameplate, Prepare, Ready, State, Stop
from wire.patience import Awaited, Patience

CLOSING = 2.0
"""Longest wait (s) for the neighbours' last states, and for word that the report on emulated links has come."""

PATIENCE = 2.0
"""An agent waits this many deadlines, so that the plant complains first."""


class AgentSide(Side):
    """One agent in simulated time.

    Parameters
    ----------
    config : AgentConfig
        Who it is and the run's rule.
    instance : str
        Which process this is, unique in the run; part of the agent's token.
    links : Links, optional
        What the links to it do to its messages.
    law : Law, optional
        What decides its set-points; the paper's if left out.
    """

    def __init__(self, config: AgentConfig, instance: str, links: Links | None = None, law: Law | None = None) -> None:
        super().__init__(config, instance, links, law)
        if config.clock_rate != 1.0:  # its periods seem longer to it than they are
            self._agent = Agent(replace(config, T_c=config.T_c * config.clock_rate), law)
        self._routes[self.keys.control] = Route(PLANT, (Prepare, Stop), self._on_control)
        self._patience = Patience(config.name, PATIENCE * config.deadline)
        self._introductions = Introductions(self._agent, instance, self.admission)
        self._turn = Turn()
        self._roster: tuple[str, ...] = ()
        """That of the last tick."""
        self._neighbours: tuple[str, ...] = ()
        """In-neighbours on it."""
        self._ending = ""
        """Why it is about to close."""
        self._reported = False
        """Whether the last report on emulated links is out."""
        self._sensed: Measurement | None = None
        """The last measurement that the link from the plant let through."""
        self._sensed_at = 0.0
        """When that came through (s of run time)."""

    # ---------------------------------------------------------------- what the driver needs

    @property
    def publications(self) -> tuple[str, ...]:
        """Keys to be published on."""
        return self.keys.ready(self._name), self.keys.state(self._name), self.keys.report(self._name)

    @property
    def wanted(self) -> int:
        """Number of messages without which the next tick cannot be computed."""
        return self._turn.wanted if self._introductions.ready else 1

    @property
    def until(self) -> float | None:
        """When the deadline of the present wait passes (s on the driver's clock); None if it has none."""
        return self._patience.until

    def start(self, now: float) -> None:
        """Begin to wait for the plant, which is built first."""
        self._patience.renew(now)
        self._patience.until = max(self._patience.until or 0.0, now + self._config.plant_wait)

    def missing(self) -> tuple[Awaited, ...]:
        """Who is awaited, and for what."""
        if not self.plant_seen:
            return (Awaited("sign of life", PLANT),)
        if self._introductions.roster is None:
            return (Awaited("Prepare", PLANT),)
        if not self._introductions.ready:
            return tuple(Awaited("nameplate", name) for name in self._introductions.missing())
        return self._turn.missing()

    def expire(self, now: float) -> None:
        """Give up if the deadline has passed."""
        if self.over or self.until is None or now < self.until:
            return
        if self._ending:
            self._report_the_last()
            self.stopped = self._ending
        else:
            self.failed = self._patience.complaint(self.missing(), now)

    # ---------------------------------------------------------------- liveliness

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared."""
        match self.keys.parts(key):
            case ("alive", "plant", epoch) if self._plant_appeared(epoch):
                # The plant may compile, or wait for agents yet to be started. Its token ends this wait if it dies.
                self._patience.rest()
            case ("alive", "agent", name, instance) if name != self._name:
                self._do(self._introductions.appeared(Peer(name, instance)), now)

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        match self.keys.parts(key):
            case ("alive", "plant", epoch) if not self._plant_vanished(epoch):
                pass  # another one, which nobody follows
            case ("alive", "plant", _) if self._ending:
                self.stopped = self._ending
            case ("alive", "plant", _) if not self.over:
                tick = "" if self._turn.tick is None else f" at tick {self._turn.tick}"
                self.failed = f"{self._name}: the plant is gone{tick}; nobody is left to compute for"
            case ("alive", "agent", name, instance):
                self._introductions.vanished(Peer(name, instance))
                self._routes.pop(self.keys.nameplate(name, instance), None)
                if self._turn.lost(name, instance):
                    self._compute(now)

    # ---------------------------------------------------------------- messages

    def _used(self, message: AnyMessage, now: float) -> None:
        self._patience.heard(message.sender, message.seq, now)

    def _on_control(self, message: Prepare | Stop, payload: bytes, now: float) -> None:
        if isinstance(message, Stop):
            self._end(message.reason, now)
        else:
            steps = self._introductions.prepare(message)
            self._patience.renew(now)
            self._do(steps, now)

    def _on_dismissal(self, message: Stop, payload: bytes, now: float) -> None:
        if message.refused:
            self.failed = message.reason
        else:
            self._end(message.reason, now)

    def _end(self, reason: str, now: float) -> None:
        """Close; with emulated links only once the neighbours' last states are booked and the plant has the book."""
        if self._links is None or self._ending:
            self.stopped = self._ending or reason
            return
        self._ending = reason
        self._patience.until = now + CLOSING
        if not self._turn.waiting:
            self._report_the_last()

    def _report_the_last(self) -> None:
        if not self._reported:
            self._reported = True
            self._report_links(final=True)

    # ---------------------------------------------------------------- introductions

    def _do(self, steps: list[Step], now: float) -> None:
        for step in steps:
            match step:
                case Ask(peer):
                    self._ask(peer)
                case Hear(name):
                    key = self.keys.state(name)
                    self._routes[key] = Route(name, (State,), self._on_state)
                    self._actions.append(Listen(key))
                case Confirm(roster):
                    self._patience.renew(now)
                    life, t = self._config.incarnation, time_of(self._turn.tick or 0, self._config.T_c)
                    ready = Ready(sender=self._name, incarnation=life, seq=roster, t=t)
                    self._publish(self.keys.ready(self._name), encode(ready))

    def _ask(self, peer: Peer) -> None:
        key = self.keys.nameplate(*peer)
        self._routes[key] = Route(peer.name, (Nameplate,), partial(self._on_nameplate, peer), early=True)
        self._actions.append(Fetch(key))

    def _on_nameplate(self, peer: Peer, message: Nameplate, payload: bytes, now: float) -> None:
        self._do(self._introductions.answered(peer, message), now)

    # ---------------------------------------------------------------- ticks

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        if not self._introductions.ready:
            raise RejectedError("unexpected", "no roster has this process on it")
        self._turn.grant(message)
        if is_usable(self._links, message, payload, message.t, self.admission):
            self._sensed, self._sensed_at = message, message.t
        self._patience.renew(now)
        self._compute(now)

    def _on_state(self, message: State, payload: bytes, now: float) -> None:
        if self._turn.take(message, payload):
            self._hear(message, payload)
            self._compute(now)

    def _hear(self, state: State, payload: bytes) -> None:
        if not state.quiet and is_usable(self._links, state, payload, state.t, self.admission):
            self._agent.hear(state)

    def _take_arrived(self, t: float) -> None:
        """Use what the emulated links have let through by t (s)."""
        for message in arrived(self._links, t, self.rejects, self.admission):
            if isinstance(message, State):
                self._agent.hear(message)
            elif isinstance(message, Measurement):
                self._sensed, self._sensed_at = message, t

    def _fresh(self, t: float) -> Measurement | None:
        """The own measurement, if it came through not longer ago than `max_age`, as in wall-clock time."""
        return None if round(t - self._sensed_at, 9) > self._config.max_age else self._sensed

    def _compute(self, now: float) -> None:
        """Compute and send the next tick, if all that it needs is here."""
        if self._ending:
            if not self._turn.waiting:
                self._report_the_last()
            return
        measurement = self._turn.granted()
        if measurement is None:
            return
        neighbours = tuple(name for name in self._neighbours if name in measurement.roster)
        self._take_arrived(measurement.t)
        fresh = self._fresh(measurement.t)
        if fresh is None or (self._links is not None and self._links.stalled(measurement.t)):
            state = self._agent.stand_still(measurement)
        else:
            sensed = replace(fresh, seq=measurement.seq, t=measurement.t)
            state = self._agent.tick(sensed, neighbours)
        self._publish(self.keys.state(self._name), encode(state))
        self._patience.renew(now)
        if (measurement.seq + 1) % REPORT_TICKS == 0:
            self._report_links()
        if measurement.roster != self._roster:
            self._roster = measurement.roster
            self._neighbours = self._agent.in_neighbours(self._roster)
        for state, payload in self._turn.next(self._introductions.living(self._neighbours)):
            self._hear(state, payload)
