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

from typing import Literal

from msgspec.structs import replace

from agents.cadence import Cadence
from agents.claims import Claims
from agents.config import AgentConfig
from agents.heard import Heard
from agents.hearing import Hearing
from agents.orders import Orders
from agents.side import REPORT_TICKS, Side
from wire.actions import Fetch, Listen, Say
from wire.codec import RejectedError, encode
from wire.links import Links
from wire.messages import PLANT, AgentStatus, AnyMessage, Leave, LinkOrder, Measurement, Nameplate, State, Stop
from wire.timer import Timer

Phase = Literal["seeking", "waiting", "running"]

STATUS_PERIOD = 0.5
"""Time (s, wall) between two `AgentStatus`; one more goes out whenever the phase or the neighbours in use change."""

SILENT = 1.0
"""Time (s, wall) without a message of the plant, or of a neighbour whom it hears, after which that one is silent."""

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
    """

    def __init__(self, config: AgentConfig, instance: str, links: Links | None = None) -> None:
        if config.speed <= 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        super().__init__(config, instance, links)
        self._orders = Orders(config.name, config.incarnation, links)
        self._routes[self.keys.order(config.name)] = (PLANT, self._on_order)
        self.phase: Phase = "seeking"
        self.astray = False
        """Whether it closes only to begin again with a new session."""
        self.missed = 0
        """Ticks skipped, as their time was over."""
        self.ticks = self.sent = self.used = 0
        self._first_routes = dict(self._routes)
        # a clock that is to drift must drift
        self._cadence = Cadence(config.T_c / config.speed / config.clock_rate, keeps_clear=config.clock_rate == 1.0)
        self._status = Timer(STATUS_PERIOD, 0.0)
        self._give_up: float | None = None
        self._lateness = 0.0
        self._ran = False
        self._heard = Heard(config.speed)
        self._hearing = Hearing()
        self._leaving = ""
        """Why it leaves, once the plant has been told."""
        self._left = 0
        """Periods since then."""
        self._forget_everybody()

    def _forget_everybody(self) -> None:
        """Know nothing of the others, as before the first session."""
        self.phase = "seeking"
        self._routes = dict(self._first_routes)
        self._plant_there = False
        self._measurement: Measurement | None = None
        self._measured_at = 0.0
        """When the last measurement arrived, over the links."""
        self._run_time = 0.0
        """That of the last measurement that came off the wire (s)."""
        self._claims = Claims()
        self._met: set[str] = set()
        """Names whose nameplate is known."""
        self._neighbours: tuple[str, ...] = ()
        self._heard.forget_all()
        self._in_sums: tuple[str, ...] = ()
        """Neighbours in the sums of the last tick."""

    # ---------------------------------------------------------------- what the driver needs

    @property
    def publications(self) -> tuple[str, ...]:
        """Keys to be published on."""
        keys, name = self.keys, self._name
        return keys.state(name), keys.leave(name), keys.status(name), keys.report(name), keys.obeyed(name)

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
            self._hearing = self._hearing.next()
            for name in self._met:
                self._agent.forget(name)
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
            if self._left * self._cadence.period >= LEAVING or not self._plant_there:
                self.stopped = self._leaving
            return
        if self._give_up is not None and not self.plant_seen and now >= self._give_up:
            self.failed = f"{self._name}: no plant of run {self._config.run} within {self._config.deadline:g} s"
            return
        if self.phase == "running":
            self.missed += skipped
            self._lateness = max(self._lateness, late)
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
        silent = self._unheard(now)
        self._hearing.whole |= self.phase == "running" and not silent
        lost = self._hearing.lost(silent, now)
        if not lost:
            return
        what = {
            PLANT: "nothing comes from the plant" + (", though it is there" if self._plant_there else ""),
            self._name: "the plant is heard, but does not hear this agent",
        }
        self._go_astray(what.get(lost, f"the plant hears {lost}, but nothing comes from it here"))

    def _unheard(self, now: float) -> tuple[str, ...]:
        """Who should be heard and is not: the plant, a neighbour that the plant hears, or oneself, by the plant."""
        if self._ran and self._heard.silence(PLANT, now) > SILENT:
            return (PLANT,)
        if self.phase != "running" or self._measurement is None:
            return ()
        self._ran = True
        roster = self._measurement.roster
        mute = () if self._name in roster else (self._name,)
        return *mute, *(name for name in roster if name != self._name and self._is_silent(name, now))

    def _is_silent(self, name: str, now: float) -> bool:
        if name not in self._met:
            return True
        return name in self._neighbours and self._heard.silence(name, now) > SILENT

    def _go_astray(self, why: str) -> None:
        self.astray = True
        self._say(f"{why}; opens a new session")

    def leave(self, reason: str) -> None:
        """Leave properly: have the own inverter taken off the network, and close once the plant says that it is."""
        if self.over or self._leaving:
            return
        self._report_links(final=True)
        self._leave()
        if self._plant_there:
            self._leaving = reason
        else:
            self.stopped = reason

    def _leave(self) -> None:
        message = Leave(sender=self._name, incarnation=self._config.incarnation, seq=self.sent, t=self._t)
        self._publish(self.keys.leave(self._name), encode(message))

    def _say(self, text: str) -> None:
        self._actions.append(Say(f"{self._name}: {text}"))

    # ---------------------------------------------------------------- liveliness

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared."""
        match self.keys.parts(key):
            case ("alive", "plant"):
                self._plant_there = self.plant_seen = True
                if self.phase == "seeking":
                    self.phase = "waiting"
                    self._say("the plant is there; waits for its measurement")
            case ("alive", "agent", name, instance) if name != self._name:
                if self._claims.appeared(name, instance):
                    self._fetch_nameplate(name)

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        match self.keys.parts(key):
            case ("alive", "plant"):
                self._plant_there = False
                self._hold("the plant is gone; holds, and seeks it again")
                self.phase = "seeking"
            case ("alive", "agent", name, instance) if self._claims.vanished(name, instance):
                self._routes.pop(self.keys.nameplate(name, instance), None)
                self._forget(name)
                if name in self._claims:
                    self._fetch_nameplate(name)

    def _fetch_nameplate(self, name: str) -> None:
        key = self.keys.nameplate(name, self._claims.instance(name))
        self._routes[key] = (name, lambda message, payload, now: self._on_nameplate(name, message))
        self._actions.append(Fetch(key))

    def _ask_again(self) -> None:
        """Ask once more for the nameplates that have not come: a question dies with its link."""
        for name in self._claims:
            if name not in self._met:
                self._fetch_nameplate(name)

    def _forget(self, name: str) -> None:
        self._met.discard(name)
        self._heard.forget(name)
        self._agent.forget(name)
        self._meet_neighbours()

    def _hold(self, why: str) -> None:
        """Stop ticking; what was heard is of no use any more."""
        if self.phase == "running":
            self.phase = "waiting"
            self._say(why)
        self._measurement, self._in_sums = None, ()
        self._heard.drop()
        self._agent.let_go()

    # ---------------------------------------------------------------- messages

    def _used(self, message: AnyMessage, now: float) -> None:
        self.used += 1

    def _misled(self, expected: str, sender: str) -> None:
        """Note a message that came under another's key; many of them prove that key numbers are confused."""
        if self._hearing.crossed() and self._ran and not self.astray:
            self._go_astray(f"messages of {sender} come under the key of {expected}")

    def _on_control(self, message: AnyMessage, payload: bytes, now: float) -> None:
        if not isinstance(message, Stop):
            raise RejectedError("unexpected", f"a {type(message).__name__} from the plant")
        if message.refused:
            self.failed = message.reason
        elif self._leaving:
            self.stopped = self._leaving
        else:
            self.leave(message.reason)

    _on_dismissal = _on_control

    def _on_measurement(self, message: AnyMessage, payload: bytes, now: float) -> None:
        if not isinstance(message, Measurement) or message.to != self._name:
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of the own Measurement")
        self._check_life(message)
        self._heard.came(message, now)
        self._cadence.measured(now)
        self._run_time = message.t
        if not self._is_offered(message, payload, now * self._config.speed):
            self._measurement, self._measured_at = message, now

    def _check_life(self, message: AnyMessage) -> None:
        """Refuse what an earlier plant said; of another one, begin anew."""
        life = self._plant_incarnation
        if message.incarnation < life:
            raise RejectedError("ghost", f"life {message.incarnation} of the plant, now it lives {life}")
        if message.incarnation > life:
            if life:
                self._hold("the plant has a new life; starts from what it measures")
                self._orders.restart()
            self._plant_incarnation = message.incarnation
            self._heard.forget(PLANT)

    def _on_order(self, message: AnyMessage, payload: bytes, now: float) -> None:
        if not isinstance(message, LinkOrder):
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of a LinkOrder")
        self._check_life(message)
        answer = self._orders.take(message, self._run_time)
        if answer is not None:
            self._publish(self.keys.obeyed(self._name), encode(answer))

    def _take_arrived(self, now: float) -> None:
        """Use what the emulated links have let through by now; what was overtaken is of no use."""
        for message in self._arrived(now * self._config.speed):
            if isinstance(message, Measurement) and message.incarnation == self._plant_incarnation:
                if self._measurement is None or message.seq > self._measurement.seq:
                    self._measurement, self._measured_at = message, now
            elif isinstance(message, State) and message.sender in self._met and not self._agent.hear(message):
                self._heard.keep(message, now)

    def _on_nameplate(self, name: str, message: AnyMessage) -> None:
        if not isinstance(message, Nameplate):
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of a Nameplate")
        if not self._agent.meet(message):
            raise RejectedError("ghost", f"life {message.incarnation} of {name}, which has a later one")
        self._met.add(name)
        self._meet_neighbours()

    def _on_state(self, message: AnyMessage, payload: bytes, now: float) -> None:
        if not isinstance(message, State):
            raise RejectedError("unexpected", f"a {type(message).__name__} instead of a State")
        reason = self._agent.judge(message)
        if reason:
            raise RejectedError(reason, f"State({message.seq}) of life {message.incarnation} of {message.sender}")
        self._heard.came(message, now)
        if self._links is not None and not self._heard.has(PLANT):
            return  # the plant tells what was ordered before it sends a measurement: till then no link is known
        if not self._is_offered(message, payload, now * self._config.speed):
            self._agent.hear(message)
            self._heard.keep(message, now)

    def _meet_neighbours(self) -> None:
        """Apply the rule to who is present, and listen to whom it names."""
        self._neighbours = self._agent.in_neighbours((self._name, *sorted(self._met)))
        for name in self._neighbours:
            key = self.keys.state(name)
            if key not in self._routes:
                self._routes[key] = (name, self._on_state)
                self._actions.append(Listen(key))

    # ---------------------------------------------------------------- ticks

    @property
    def _t(self) -> float:
        return 0.0 if self._measurement is None else self._measurement.t

    def _age(self, name: str, now: float) -> float:
        """Age of a neighbour's last state (s of run time); infinite if none was heard."""
        return self._heard.age(name, now, self._t)

    def _young(self, now: float) -> tuple[str, ...]:
        limit = self._config.control.handling.max_age or self._config.max_age
        return tuple(name for name in self._neighbours if self._age(name, now) <= limit)

    def _tick(self, now: float) -> None:
        if not self._plant_there:
            return  # what the dead plant said last would still look fresh
        measurement, config = self._measurement, self._config
        if measurement is None or (now - self._measured_at) * config.speed > config.max_age:
            self._hold("no measurement of late; holds")
            return
        if self.phase != "running":
            self.phase = "running"
            self._say(f"joins at t = {measurement.t:g} s, from {measurement.P_set:.0f} W and {measurement.V_set:.1f} V")
        young = self._young(now)
        ages = {name: self._age(name, now) for name in young}
        state = replace(self._agent.tick(measurement, young, ages), seq=self.sent)
        self._in_sums = tuple(name for name in young if self._agent.shares_island(name))
        self.ticks += 1
        self.sent += 1
        if self.ticks % REPORT_TICKS == 0:
            self._report_links()
        self._publish(self.keys.state(self._name), encode(state))

    def _publish_status(self, now: float) -> None:
        awaited = {
            "seeking": f"the plant of run {self._config.run}",
            "waiting": f"a measurement of {self._name} from the plant",
            "running": "",
        }
        ages = [self._age(name, now) for name in self._neighbours]
        status = AgentStatus(
            sender=self._name,
            incarnation=self._config.incarnation,
            seq=self.sent,
            t=self._t,
            phase=self.phase,
            waits_for=awaited[self.phase],
            island="" if self._measurement is None else self._measurement.island,
            neighbours=self._neighbours,
            ages=tuple(age if age < float("inf") else -1.0 for age in ages),
            used=self._in_sums,
            received=self.used,
            sent=self.sent,
            rejected=sum(self.rejects.counts.values()),
            lost=self._heard.lost,
            ticks=self.ticks,
            missed=self.missed,
            lateness=self._lateness,
            impaired=() if self._links is None else self._links.impaired(self._run_time),
        )
        self._lateness = 0.0
        self._publish(self.keys.status(self._name), encode(status))
