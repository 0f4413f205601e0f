"""The agent's side of wall-clock time, sans-IO: tokens, messages and the time in, actions out.

The driver is that of `agents.lockstep`, and so is the `Agent` inside; but nobody grants a tick. An agent ticks on its
own timer, with what it heard last:

- its *measurement*, if it is not older than `max_age`; else it holds, and says nothing to its neighbours;
- the last state of each *neighbour* whose token is there, whose value is not older than `max_age`, and who stands in
  the same island. The age is that on the own clock; but a state that was long on its way is as old as its run time
  says, beside that of the own measurement.

Ages are in s of run time. Tokens say who exists, never who works: a frozen process keeps its token for seconds.

**Phases.** *seeking*: there is no plant. *waiting*: the plant is there, but has not sent a measurement of late.
*running*: it ticks. Whoever comes back to *running* starts from the set-points that its measurement shows: those the
plant holds for it. An agent that finds itself woken late (frozen, or starved) drops what it knew and waits for news.

**Names.** Of two processes that claim one name the first counts, until its token is gone; then it is forgotten.
"""

from __future__ import annotations

from functools import partial

from msgspec.structs import replace

from agents.config import AgentConfig
from agents.freerun.cadence import Cadence
from agents.freerun.heard import Heard
from agents.freerun.orders import Orders
from agents.freerun.peers import Peers
from agents.freerun.roll_call import RollCall
from agents.freerun.tally import Phase, Tally
from agents.laws.law import Law
from agents.side import REPORT_TICKS, Side
from wire.actions import Fetch, Listen, Say
from wire.admission import FASTER
from wire.codec import encode
from wire.endpoint import Route
from wire.links import Links, arrived, is_usable
from wire.messages import PLANT, AnyMessage, Leave, LinkOrder, Measurement, Nameplate, State, Stop, Waiting
from wire.timer import Timer

STATUS_PERIOD = 0.5
"""Time (s, wall) between two `AgentStatus`; one more goes out whenever the phase or the neighbours in use change."""

LEAVING = 1.0
"""Longest wait (s, wall) for the plant's word that it has taken the inverter off: a session that closes at once can
take what was sent last with it."""

WANTED = 1 << 30
"""Messages wait for the next tick; only tokens and words wake the agent before."""


class FreeAgent(Side):
    """One agent in wall-clock time, on one session after the other if need be.

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
        if config.speed <= 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        super().__init__(config, instance, links, law, rate=FASTER / config.T_c)
        self._followed = 0
        """Epoch of the plant that was followed last; 0 before the first."""
        self._orders = Orders(config.name, config.incarnation, links)
        self._routes[self.keys.control] = Route(PLANT, (Waiting, Stop), self._on_control)
        self._routes[self.keys.order(config.name)] = Route(PLANT, (LinkOrder,), self._on_order)
        self.phase: Phase = "seeking"
        self.astray = False
        """Whether it closes only to begin again with a new session."""
        self.tally = Tally()
        """What it has done."""
        self._first_routes = dict(self._routes)
        # a clock that is to drift must drift
        self._cadence = Cadence(config.T_c / config.speed / config.clock_rate, keeps_clear=config.clock_rate == 1.0)
        self._status = Timer(STATUS_PERIOD, 0.0)
        self._give_up: float | None = None
        self.heard = Heard(config.speed)
        """What came, and how old it is."""
        self._peers = Peers(self._agent, self.admission)
        self._roll_call = RollCall(config.name, self.heard, self._peers)
        self._leaving = ""
        """Why it leaves, once the plant has been told."""
        self._ran = False
        """Whether it has ticked in the present life of the plant."""
        self._left = 0
        """Periods since then."""
        self._skipped = 0
        """States since the last that neighbours were sent."""
        self._forget_everybody()

    def _forget_everybody(self) -> None:
        """Know nothing of the others, as before the first session."""
        self.phase = "seeking"
        self._routes = dict(self._first_routes)
        self._plants.clear()
        self.admission.release(PLANT)
        self._awaited: tuple[str, ...] = ()
        """For whom the plant said last that it waits."""
        self._run_time = 0.0
        """That of the last measurement that came off the wire (s)."""
        self._peers.forget_all()
        self.heard.forget_all()
        self._in_sums: tuple[str, ...] = ()
        """Neighbours in the sums of the last tick."""

    # ---------------------------------------------------------------- what the driver needs

    @property
    def publications(self) -> tuple[str, ...]:
        """Keys to be published on."""
        keys, name = self.keys, self._name
        own = (keys.state, keys.set_points, keys.leave, keys.status, keys.report, keys.obeyed)
        return tuple(key(name) for key in own)

    @property
    def over(self) -> bool:
        """Whether the driver should close."""
        return super().over or self.astray

    @property
    def wanted(self) -> int:
        """Number of messages to be woken for: messages wait for the tick."""
        return WANTED

    @property
    def until(self) -> float:
        """When the next tick is due (s on the driver's clock)."""
        return self._cadence.due

    def start(self, now: float) -> None:
        """Begin to tick, or begin again after a session that had gone astray; there is nothing to do yet."""
        self._cadence.start(now)
        self._status = Timer(STATUS_PERIOD, now)
        if self._config.deadline > 0.0:
            self._give_up = now + self._config.deadline
        if self.astray:
            self.astray = False
            self._roll_call.next_session()
            self._agent.let_go()
            self._forget_everybody()

    def expire(self, now: float) -> None:
        """Tick, if it is time."""
        late = now - self._cadence.due
        if late < 0.0 or self.over:
            return
        skipped = self._cadence.take(now)
        if self._leaving:
            self._left += 1
            if self._left * self._cadence.period >= LEAVING or not self._plants:
                self.stopped = self._leaving
            return
        if self._give_up is not None and not self.plant_seen and now >= self._give_up:
            self.failed = f"{self._name}: no plant of run {self._config.run} within {self._config.deadline:g} s"
            return
        if self.phase == "running":
            self.tally.woken(late, skipped)
            if late * self._config.speed > self._config.max_age:
                self._hold(f"woken {late:.2f} s late; waits for news")
        self._take_arrived(now)
        before = self.phase, self._in_sums
        self._tick(now)
        self._note_astray(now)
        due = now >= self._status.due
        if due:
            self._status.take(now)
            self._ask_again()
        if due or (self.phase, self._in_sums) != before:
            self._publish_status(now)

    def _note_astray(self, now: float) -> None:
        """Ask for a new session if this one has not brought what it should, or not taken it, for too long."""
        measured = self.heard.measurement if self.phase == "running" else None
        roster = None if measured is None else measured.roster
        if roster is not None and self._agent.fault:
            roster = (*roster, self._name)  # who says nothing is not heard, and no session changes that
        why = self._roll_call.complaint(roster, now)
        if why:
            self._go_astray(why)

    def _go_astray(self, why: str) -> None:
        self.astray = True
        self._say(f"{why}; opens a new session")

    def leave(self, reason: str) -> None:
        """Leave properly: have the own inverter taken off the network, and close once the plant says that it is."""
        if self.over or self._leaving:
            return
        self._report_links(final=True)
        name, life = self._name, self._config.incarnation
        message = Leave(sender=name, incarnation=life, seq=self.tally.sent, t=self.heard.t)
        self._publish(self.keys.leave(name), encode(message))
        if self._plants:
            self._leaving = reason
        else:
            self.stopped = reason

    def _say(self, text: str) -> None:
        self._actions.append(Say(f"{self._name}: {text}"))

    # ---------------------------------------------------------------- liveliness

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared."""
        match self.keys.parts(key):
            case ("alive", "plant", epoch) if self._plant_appeared(epoch):
                self._roll_call.plant_seen(now)
                if self.phase == "seeking":
                    self.phase = "waiting"
                    self._say("the plant is there; waits for its measurement")
            case ("alive", "agent", name, instance) if name != self._name:
                if self._peers.appeared(name, instance):
                    self._fetch_nameplate(name, instance)

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        match self.keys.parts(key):
            case ("alive", "plant", epoch) if self._plant_vanished(epoch):
                self._hold("the plant is gone; holds, and seeks it again")
                self.phase = "waiting" if self._plants else "seeking"
            case ("alive", "agent", name, instance) if self._peers.vanished(name, instance):
                self._routes.pop(self.keys.nameplate(name, instance), None)
                self.heard.forget(name)
                self._listen()
                self._ask_again(name)

    def _fetch_nameplate(self, name: str, instance: str) -> None:
        key = self.keys.nameplate(name, instance)
        self._routes[key] = Route(name, (Nameplate,), partial(self._on_nameplate, instance), early=True)
        self._actions.append(Fetch(key))

    def _ask_again(self, *names: str) -> None:
        """Ask for the nameplates that have not come, of all or of some: a question dies with its link."""
        for name, instance in self._peers.unknown:
            if not names or name in names:
                self._fetch_nameplate(name, instance)

    def _listen(self) -> None:
        """Listen to whom the rule names."""
        for name in self._peers.neighbours:
            key = self.keys.state(name)
            if key not in self._routes:
                self._routes[key] = Route(name, (State,), self._on_state)
                self._actions.append(Listen(key))

    def _hold(self, why: str) -> None:
        """Stop ticking; what was heard is of no use any more."""
        if self.phase == "running":
            self.phase = "waiting"
            self._say(why)
        self._in_sums = ()
        self.heard.drop()
        self._agent.let_go()

    # ---------------------------------------------------------------- messages

    def _used(self, message: AnyMessage, now: float) -> None:
        self.tally.used += 1

    def _misled(self, expected: str, message: AnyMessage, now: float) -> None:
        if self.admission.lives(message):
            self._roll_call.crossed(message.sender, expected, now)

    def _follow(self, epoch: int) -> None:
        """Begin anew with another plant; one whose token was gone for a while goes on where it was."""
        if self._followed not in (0, epoch):
            self._hold("the plant has a new life; starts from what it measures")
            self._ran = False
            self._orders.restart()
            self.heard.forget(PLANT)
        self._followed = epoch

    def _on_control(self, message: Waiting | Stop, payload: bytes, now: float) -> None:
        if isinstance(message, Waiting):
            self._roll_call.plant_seen(now)
            self._awaited = message.waits_for
        elif message.refused:
            self.failed = message.reason
        elif self._leaving:
            self.stopped = self._leaving
        else:
            self.leave(message.reason)

    _on_dismissal = _on_control

    def _came(self, message: State | Measurement, now: float) -> None:
        """Note what came off the wire, and how many did not."""
        missed = self.admission.take(message)
        self.tally.lost += max(0, missed - message.skipped) if isinstance(message, State) else missed
        self.heard.came(message.sender, now)

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        self._came(message, now)
        self._cadence.measured(now)
        self._run_time, self._awaited = message.t, ()
        self._use(message, payload, now)

    def _on_order(self, message: LinkOrder, payload: bytes, now: float) -> None:
        answer = self._orders.take(message, self._run_time)
        if answer is not None:
            self._publish(self.keys.obeyed(self._name), encode(answer))

    def _on_nameplate(self, instance: str, message: Nameplate, payload: bytes, now: float) -> None:
        self._peers.meet(instance, message)
        self._listen()

    def _on_state(self, message: State, payload: bytes, now: float) -> None:
        self._came(message, now)
        if self._links is not None and not self.heard.has(PLANT):
            return  # the plant tells what was ordered before it sends a measurement: till then no link is known
        self._use(message, payload, now)

    def _use(self, message: State | Measurement, payload: bytes, now: float) -> None:
        """Use a message, unless an emulated link takes it, and perhaps lets it through later."""
        if is_usable(self._links, message, payload, now * self._config.speed, self.admission):
            self._keep(message, now)

    def _take_arrived(self, now: float) -> None:
        """Use what the emulated links have let through by now."""
        for message in arrived(self._links, now * self._config.speed, self.rejects, self.admission):
            if isinstance(message, State | Measurement):
                self._keep(message, now)

    def _keep(self, message: State | Measurement, now: float) -> None:
        if isinstance(message, State):
            self._agent.hear(message)
        self.heard.keep(message, now)

    # ---------------------------------------------------------------- ticks

    def _young(self, now: float) -> tuple[str, ...]:
        limit = self._config.control.handling.max_age or self._config.max_age
        return tuple(name for name in self._peers.neighbours if self.heard.age(name, now) <= limit)

    def _tick(self, now: float) -> None:
        if self.admission.epoch(PLANT) is None:
            return  # what the dead plant said last would still look fresh
        measurement = self.heard.measured(now, self._config.max_age)
        if measurement is None:
            self._hold("no measurement of late; holds")
            return
        if self.phase != "running":
            self.phase = "running"
            m, joins = measurement, "goes on" if self._ran else "joins"
            self._say(f"{joins} at t = {m.t:.2f} s, from {m.P_set:.0f} W and {m.V_set:.1f} V")
            self._ran = True
        if self._agent.fault:
            return
        young = self._young(now)
        ages = {name: self.heard.age(name, now) for name in young}
        state = replace(self._agent.tick(measurement, young, ages), seq=self.tally.sent)
        self._in_sums = tuple(name for name in young if self._agent.shares_island(name))
        self.tally.ticks += 1
        self.tally.sent += 1
        if self.tally.ticks % REPORT_TICKS == 0:
            self._report_links()
        self._tell(state)

    def _tell(self, state: State) -> None:
        """Send a state to everybody, or to the plant alone if the law does not tell the neighbours."""
        if state.fault:
            self._say(f"{state.fault}; stands still, its inverter stays on primary droop")
        if state.quiet:
            self._skipped += 1
            self._publish(self.keys.set_points(self._name), encode(state))
        else:
            state, self._skipped = replace(state, skipped=self._skipped) if self._skipped else state, 0
            self._publish(self.keys.state(self._name), encode(state))

    def _publish_status(self, now: float) -> None:
        status = self.tally.take_status(
            self._config,
            self.phase,
            self.heard,
            now,
            awaited=self._awaited,
            neighbours=self._peers.neighbours,
            in_sums=self._in_sums,
            rejected=sum(self.rejects.counts.values()),
            dropped=0 if self._links is None else self._links.dropped,
            impaired=() if self._links is None else self._links.impaired(self._run_time),
        )
        self._publish(self.keys.status(self._name), encode(status))
