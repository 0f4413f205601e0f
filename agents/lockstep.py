"""The agent's side of simulated time, sans-IO: tokens and messages in, actions out.

A driver (`agents.runtime` over Zenoh, `scenarios.drivers.inprocess` on a bus) does, from one thread,

    side.appeared(key, now) | side.vanished(key, now)       a liveliness token came or went
    side.received(key, payload, now)                        a message, or the answer to a `Fetch`
    for action in side.take_actions(): ...                  do it, in this order
    side.expire(now)                                        when `side.until` has passed

until `side.over`, the last actions included. `now` is the driver's clock (s) and serves deadlines only: nothing that is
computed depends on it.

**Finding each other.** Nothing tells an agent who exists. For every token of another agent it fetches the nameplate.
Whom the rule makes its in-neighbour it listens to, then fetches the nameplate once more: subscription and query take
the same way in the same order, so the answer proves that the neighbour's publications will come. For rules that
look at pairs this happens at once; for a ring, when `Prepare` has named the roster. `Ready` goes to the plant when all
nameplates of the roster are known and all in-neighbours proven.

**Ticking.** Measurement(k) is the grant of tick k. With it and State(k-1) of every in-neighbour on roster k-1 the agent
computes and sends State(k). A State(k) that overtakes the own Measurement(k) is kept back until tick k is done, so
what is used never depends on who was faster. Whoever is no longer on roster k is left out at once, so that it does not
matter whether its last state or its end is heard first. At its first tick an agent has no roster k-1 and listens to
nobody.

**No deadlock.** State(k) waits for Measurement(k) and States(k-1) only, Measurement(k) for States(k-1) only: every
wait is for something earlier, so the earliest thing not yet sent always can be, if its sender lives. The token of a
dead process vanishes, which ends the wait for it: its last value counts once more, and the next roster leaves it out.
What neither sends nor dies meets the deadline. The agent's is twice the plant's, so that the plant, who sees all, names
the culprit. Receivers only enqueue, without bound, so nobody blocks a sender.
"""

from __future__ import annotations

from msgspec.structs import replace

from agents.agent import Agent
from agents.config import AgentConfig
from agents.side import REPORT_TICKS, Side
from agents.topology import is_pairwise
from wire.actions import Fetch, Listen
from wire.clock import time_of
from wire.codec import RejectedError, encode
from wire.links import Links
from wire.messages import PLANT, AnyMessage, Measurement, Nameplate, Prepare, Ready, State, Stop
from wire.patience import Awaited, Patience

Peer = tuple[str, str]
"""Name and instance of an agent."""

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
    """

    def __init__(self, config: AgentConfig, instance: str, links: Links | None = None) -> None:
        super().__init__(config, instance, links)
        if config.clock_rate != 1.0:  # its periods seem longer to it than they are
            self._agent = Agent(replace(config, T_c=config.T_c * config.clock_rate))
        self._T_c, self._incarnation = config.T_c, config.incarnation
        self._pairwise = is_pairwise(config.control)
        self._patience = Patience(config.name, PATIENCE * config.deadline)
        self._known: dict[Peer, bool] = {}
        """Peers whose nameplate is known; True once they have proven to hear our subscription."""
        self._proving: set[Peer] = set()
        self._vanished: set[Peer] = set()
        """Peers whose token is gone."""
        self._prepare: Prepare | None = None
        self._members: dict[str, str] = {}
        self._ready_sent = False
        self._tick: int | None = None
        self._measurement: Measurement | None = None
        self._roster: tuple[str, ...] = ()
        self._neighbours: tuple[str, ...] = ()
        self._waiting: dict[str, str] = {}
        """In-neighbours, and their instances, whose state of the tick before has not come yet."""
        self._ahead: dict[str, tuple[State, bytes]] = {}
        self._ending = ""
        """Why it is about to close."""
        self._reported = False
        """Whether the last report on emulated links is out."""
        self._sensed: Measurement | None = None
        """The last measurement that the link from the plant let through."""

    # ---------------------------------------------------------------- what the driver needs

    @property
    def publications(self) -> tuple[str, ...]:
        """Keys to be published on."""
        return self.keys.ready(self._name), self.keys.state(self._name), self.keys.report(self._name)

    @property
    def wanted(self) -> int:
        """Number of messages without which the next tick cannot be computed."""
        if self._tick is None or not self._ready_sent:
            return 1
        return max(1, len(self._waiting) + (self._measurement is None))

    @property
    def until(self) -> float | None:
        """When the deadline of the present wait passes (s on the driver's clock); None if it has none."""
        return self._patience.until

    def start(self, now: float) -> None:
        """Begin to wait for the plant."""
        self._patience.renew(now)

    def missing(self) -> tuple[Awaited, ...]:
        """Who is awaited, and for what."""
        if not self.plant_seen:
            return (Awaited("sign of life", PLANT),)
        if self._prepare is None:
            return (Awaited("Prepare", PLANT),)
        if not self._ready_sent:
            return tuple(Awaited("nameplate", name) for name in self._unproven())
        tick = self._tick or 0
        if self._measurement is None:
            return (Awaited(f"Measurement({tick})", PLANT),)
        return tuple(Awaited(f"State({tick - 1})", name) for name in self._neighbours if name in self._waiting)

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
            case ("alive", "plant"):
                self.plant_seen = True
                # The plant may compile, or wait for agents yet to be started. Its token ends this wait if it dies.
                self._patience.rest()
            case ("alive", "agent", name, instance) if name != self._name:
                self._vanished.discard((name, instance))
                self._fetch_nameplate((name, instance))

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        match self.keys.parts(key):
            case ("alive", "plant") if self._ending:
                self.stopped = self._ending
            case ("alive", "plant") if not self.over:
                tick = "" if self._tick is None else f" at tick {self._tick}"
                self.failed = f"{self._name}: the plant is gone{tick}; nobody is left to compute for"
            case ("alive", "agent", name, instance):
                peer = name, instance
                self._vanished.add(peer)
                self._known.pop(peer, None)
                self._proving.discard(peer)
                self._routes.pop(self.keys.nameplate(*peer), None)
                if self._waiting.get(name) == instance:
                    del self._waiting[name]
                    self._compute(now)

    # ---------------------------------------------------------------- messages

    def _used(self, message: AnyMessage, now: float) -> None:
        self._patience.heard(message.sender, message.seq, now)

    def _check_plant(self, message: AnyMessage) -> None:
        if message.incarnation < self._plant_incarnation:
            raise RejectedError(
                "ghost", f"life {message.incarnation} of the plant, now it lives {self._plant_incarnation}"
            )
        self._plant_incarnation = message.incarnation

    def _on_control(self, message: AnyMessage, payload: bytes, now: float) -> None:
        self._check_plant(message)
        if isinstance(message, Stop):
            self._end(message.reason, now)
        elif isinstance(message, Prepare):
            self._on_prepare(message, now)
        else:
            raise RejectedError("unexpected", f"a {type(message).__name__} from the plant")

    def _on_dismissal(self, message: AnyMessage, payload: bytes, now: float) -> None:
        self._check_plant(message)
        if not isinstance(message, Stop):
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of a Stop")
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
        if not self._waiting:
            self._report_the_last()

    def _report_the_last(self) -> None:
        if not self._reported:
            self._reported = True
            self._report_links(final=True)

    def _on_prepare(self, message: Prepare, now: float) -> None:
        if len(message.instances) != len(message.roster):
            raise RejectedError("garbled", f"{len(message.roster)} names but {len(message.instances)} instances")
        if self._prepare is not None and message.seq <= self._prepare.seq:
            raise RejectedError("stale", f"roster {message.seq}, {self._prepare.seq} is known")
        members = dict(zip(message.roster, message.instances, strict=True))
        if members.get(self._name) != self._instance:
            raise RejectedError("unexpected", f"roster {message.seq} is without this process")
        self._prepare, self._members, self._ready_sent = message, members, False
        self._patience.renew(now)
        self._make_ready(now)

    def _fetch_nameplate(self, peer: Peer) -> None:
        key = self.keys.nameplate(*peer)
        if key not in self._routes:
            self._routes[key] = (peer[0], lambda message, payload, now: self._on_nameplate(peer, message, now))
            self._actions.append(Fetch(key))

    def _on_nameplate(self, peer: Peer, message: AnyMessage, now: float) -> None:
        if not isinstance(message, Nameplate):
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of a Nameplate")
        if peer in self._proving:
            self._proving.discard(peer)
            self._known[peer] = True
        elif peer not in self._known:
            if not self._agent.meet(message):
                raise RejectedError("ghost", f"life {message.incarnation} of {peer[0]}, which has a later one")
            self._known[peer] = False
            if self._pairwise and self._agent.in_neighbours((self._name, peer[0])):
                self._listen_to(peer)
        self._make_ready(now)

    def _listen_to(self, peer: Peer) -> None:
        state = self.keys.state(peer[0])
        if state not in self._routes:
            self._routes[state] = (peer[0], self._on_state)
            self._actions.append(Listen(state))
        self._proving.add(peer)
        self._actions.append(Fetch(self.keys.nameplate(*peer)))

    def _unproven(self) -> list[str]:
        """Members whose nameplate is missing; when there is none, in-neighbours without proof."""
        unknown = [name for name, instance in self._members.items() if not self._has_met((name, instance))]
        neighbours = self._agent.in_neighbours(self._members)
        return unknown or [name for name in neighbours if not self._known[name, self._members[name]]]

    def _has_met(self, peer: Peer) -> bool:
        return peer in self._known or peer[0] == self._name

    def _make_ready(self, now: float) -> None:
        if self._prepare is None or self._ready_sent:
            return
        unproven = self._unproven()
        for name in unproven:
            peer = name, self._members[name]
            if self._has_met(peer) and peer not in self._proving:
                self._listen_to(peer)
        if not unproven:
            self._ready_sent = True
            self._patience.renew(now)
            ready = Ready(
                sender=self._name,
                incarnation=self._incarnation,
                seq=self._prepare.seq,
                t=time_of(self._tick or 0, self._T_c),
            )
            self._publish(self.keys.ready(self._name), encode(ready))

    # ---------------------------------------------------------------- ticks

    def _on_measurement(self, message: AnyMessage, payload: bytes, now: float) -> None:
        self._check_plant(message)
        if not isinstance(message, Measurement) or message.to != self._name:
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of the own Measurement")
        if not self._ready_sent:
            raise RejectedError("unexpected", "no roster has this process on it")
        if self._tick is None:
            self._tick = message.seq
            self._ahead = {name: early for name, early in self._ahead.items() if early[0].seq == message.seq}
        if message.seq != self._tick or self._measurement is not None:
            kind = "unexpected" if message.seq > self._tick else "stale"
            raise RejectedError(kind, f"tick {message.seq}, but {self._tick} is next")
        self._measurement = message
        if not self._is_offered(message, payload, message.t):
            self._sensed = message
        self._patience.renew(now)
        self._compute(now)

    def _on_state(self, message: AnyMessage, payload: bytes, now: float) -> None:
        if not isinstance(message, State):
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of a State")
        name, seq = message.sender, message.seq
        reason = self._agent.judge(message)
        if reason:
            raise RejectedError(reason, f"State({seq}) of life {message.incarnation} of {name}")
        if self._tick is None or seq == self._tick:
            self._ahead[name] = message, payload
        elif seq == self._tick - 1:
            self._hear(message, payload)
            self._waiting.pop(name, None)
            self._compute(now)
        else:
            kind = "stale" if seq < self._tick else "unexpected"
            raise RejectedError(kind, f"State({seq}) of {name} before tick {self._tick}")

    def _hear(self, state: State, payload: bytes) -> None:
        if not self._is_offered(state, payload, state.t):
            self._agent.hear(state)

    def _take_arrived(self, t: float) -> None:
        """Use what the emulated links have let through by t (s); what was overtaken is of no use."""
        for message in self._arrived(t):
            if isinstance(message, State):
                self._agent.hear(message)
            elif isinstance(message, Measurement) and (self._sensed is None or message.seq > self._sensed.seq):
                self._sensed = message

    def _compute(self, now: float) -> None:
        """Compute and send the next tick, if all that it needs is here."""
        measurement, tick = self._measurement, self._tick
        if self._ending and not self._waiting:
            self._report_the_last()
        if measurement is None or tick is None or self._ending:
            return
        for name in self._waiting.keys() - set(measurement.roster):
            del self._waiting[name]
        if self._waiting:
            return
        neighbours = tuple(name for name in self._neighbours if name in measurement.roster)
        self._take_arrived(measurement.t)
        sensed = self._sensed or measurement  # the first one is how the agent is set up, and always there
        if sensed is not measurement:
            sensed = replace(sensed, seq=tick, t=measurement.t)
        stalled = self._links is not None and self._links.stalled(measurement.t)
        # A paused agent's state is for the lock-step alone: no link lets it through.
        state = self._agent.stand_still(measurement) if stalled else self._agent.tick(sensed, neighbours)
        self._publish(self.keys.state(self._name), encode(state))
        self._patience.renew(now)
        self._tick, self._measurement = tick + 1, None
        if self._tick % REPORT_TICKS == 0:
            self._report_links()
        if measurement.roster != self._roster:
            self._roster = measurement.roster
            self._neighbours = self._agent.in_neighbours(self._roster)
        members = ((name, self._members.get(name, "")) for name in self._neighbours)
        self._waiting = {name: instance for name, instance in members if (name, instance) not in self._vanished}
        for name, early in self._ahead.items():
            self._hear(*early)
            self._waiting.pop(name, None)
        self._ahead = {}
