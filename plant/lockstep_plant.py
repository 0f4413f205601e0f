"""The plant under simulated time: it advances when the whole roster has decided. Pure; `now` serves deadlines only.

*gathering*: until every agent of the configuration has a token and a nameplate, and every recorder a token.
*preparing*: from `Prepare` with the roster, until every agent on it is `Ready`.
*ticking*: from Measurement(k), until the whole roster has sent State(k). Then the plant holds the set-points, advances
to k+1 and sends Measurement(k+1). A change of the roster goes through *preparing* again, between two ticks.
*joining*: the plant holds the tick until the scheduled newcomers have a token and a nameplate; telemetry names them,
once, as awaited. Because the tick is held, no number depends on how long a process took to start.
*holding*: between two ticks, while much telemetry has no acknowledgement of the recorder. It has no deadline: a
recorder that stands still is waited for. `Waiting` says so to the agents.
*closing*: from `Stop`, until all tokens are gone, as proof that every node has heard it, and recorders have all.

What may be lost is asked again every `AGAIN`: for nameplates, and by the same `Prepare` for each `Ready`. The process
that records also starts the agents: while it is silent, no deadline for an agent to come passes.

At a scheduled leave the plant sends the agent a stop request and disconnects its inverter; at a join it connects the
inverter at no load. At a scheduled death it sends the stop request, but the inverter stays. When an agent dies by
itself, the plant removes it from the roster and the run continues, marked not reproducible; a death before tick 0
ends the run, because it would be another run. `gridpeers.agents.lockstep_agent` explains why there is no deadlock.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Literal

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.plant_node import CLOSING, STAYS, PlantNode, TickActions
from gridpeers.plant.telemetry_reporter import UnacknowledgedTelemetry, measurement_of
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.journal import TickTraffic
from gridpeers.wire.links import REPORT_TICKS, Links
from gridpeers.wire.membership import is_usable
from gridpeers.wire.messages import (
    PLANT,
    Answer,
    Command,
    Journal,
    LinkReport,
    Measurement,
    Nameplate,
    Prepare,
    Ready,
    State,
    Waiting,
)
from gridpeers.wire.node import Publish
from gridpeers.wire.post import ANYBODY, Route
from gridpeers.wire.timing import Awaited, TickBarrier

Phase = Literal["gathering", "preparing", "ticking", "joining", "holding", "closing", "over"]

TELEMETRY_TICKS = 10  # ticks between two telemetry messages after tick 0: enough for a progress bar
AGAIN = 1.0  # time (s) after which a question without an answer is asked again
SILENT = 3.0  # time (s) after a recorder's last word after which it counts as silent; it speaks every second


class LockstepPlant(PlantNode):
    def __init__(self, config: PlantConfig, plant: PlantLike, links: Links | None = None) -> None:
        super().__init__(config, plant, links)
        if self._end_tick is None:
            raise ValueError("end: a run in simulated time must have one; give a multiple of T_c in s")
        self.reproducible = True
        self.phase: Phase = "gathering"
        self._plant = plant
        joiners = {name for actions in self._schedule.values() for name in actions.join}.difference(config.agents)
        self._everyone = (*config.agents, *(name for name in plant.inverters if name in joiners))
        self._roster: tuple[str, ...] = ()  # agents of the last roster sent
        self._roster_number = -1
        self._roster_changed = False  # whether an agent has joined or gone since
        self._joining: tuple[str, ...] = ()  # newcomers that the held tick waits for; they may appear then
        self._barrier = TickBarrier(PLANT, config.deadline)
        self._barrier.last_heard = self.post.last_heard
        self._ask_at = inf  # when open questions are asked again (s on the driver's clock)
        self._unacknowledged = UnacknowledgedTelemetry(config.recorders)
        self._recorders_at = dict.fromkeys(config.recorders, -inf)  # when each recorder spoke last (s, driver's clock)
        self._prepare_bytes = b""  # the last roster sent
        self._states: dict[str, State] = {}
        for name in self._everyone:
            self.routes[self.keys.state(name)] = Route(name, (State,), self._on_state)
            self.routes[self.keys.ready(name)] = Route(name, (Ready,), self._on_ready)
            self.routes[self.keys.report(name)] = Route(name, (LinkReport,), self._on_report)
            self.routes[self.keys.journal(name)] = Route(name, (Journal,), self._on_journal)
        if config.recorders:
            self.routes[self.keys.request] = Route(ANYBODY, (Command,), self._on_request)
        self.subscriptions = tuple(self.routes)
        self._tick_traffic: TickTraffic | None = None
        if self.post.journal is not None:
            self._tick_traffic = self.post.traffic = TickTraffic(self.keys, self._everyone, self.post.journal)
        self._measurement_keys = {name: self.keys.measurement(name) for name in self._everyone}

    # ---------------------------------------------------------------- what the driver needs

    @property
    def publications(self) -> tuple[str, ...]:
        return self.keys.control, self.keys.telemetry, *self._measurement_keys.values()

    @property
    def finished(self) -> bool:
        return self.phase == "over"

    @property
    def messages_needed(self) -> int:
        return self._barrier.messages_needed

    @property
    def deadline(self) -> float | None:
        deadline = min(self._barrier.deadline or inf, self._ask_at)
        return None if deadline == inf else deadline

    def start(self, now: float) -> None:
        self._barrier.renew(now)
        self._ask_at = now + AGAIN
        self._gather(now)

    def missing_messages(self) -> tuple[Awaited, ...]:
        match self.phase:
            case "gathering":
                absent = [name for name in self.config.recorders if name not in self._recorders]
                return *self._unmet(self.config.agents), *(Awaited("token", name) for name in absent)
            case "joining":
                return self._unmet(self._joining)
            case "preparing" | "ticking":
                return self._barrier.missing_messages()
        return ()

    def expire(self, now: float) -> None:
        if now >= self._ask_at:
            self._ask_again(now)
        if self._barrier.is_over(now):
            if self.phase == "closing":
                self._send_the_last()
                self._barrier.deadline = now + CLOSING
                if self._unacknowledged.is_empty:
                    self._be_over()
            elif self.phase in ("gathering", "joining") and any(
                now > at + SILENT for at in self._recorders_at.values()
            ):
                self._barrier.renew(now)
            elif missing := self.missing_messages():  # else the last awaited message has just arrived
                self.abort(self._barrier.complaint(missing, now), now)

    def abort(self, reason: str, now: float) -> None:
        if self.phase not in ("closing", "over"):
            self.outcome = reason
            self.reproducible = False
            self._close(reason, now)

    interrupt = abort  # end the run because this process must leave

    # ---------------------------------------------------------------- liveliness

    def _unmet(self, names: tuple[str, ...]) -> tuple[Awaited, ...]:
        here = {name for name in names if self.members.instance(name)}
        tokens = [Awaited("token", name) for name in names if name not in here]
        met = self.members.nameplates
        return *tokens, *(Awaited("nameplate", name) for name in names if name in here and name not in met)

    def _refusal(self, name: str, instance: str) -> str:
        if name not in self._everyone:
            return f"{name}: the plant waits for no agent of this name, only for {', '.join(self._everyone)}"
        if self._is_taken(name, instance):
            return f"{name}: another agent of this name takes part in the run already; give this one another name"
        if self.phase == "gathering" and name not in self.config.agents:
            return f"{name}: the scenario lets it join later; start it when the plant awaits it"
        if self.phase != "gathering" and not self.members.instance(name) and name not in self._joining:
            return f"{name}: the run has begun, at t = {self.t:g} s; an agent can join only before its start"
        return ""

    def _recorder_came(self, name: str, now: float) -> None:
        self._gather(now)

    def _met(self, nameplate: Nameplate, now: float) -> None:
        if self.phase == "gathering":
            self._barrier.renew(now)
        self._gather(now)

    def _ask_again(self, now: float) -> None:
        self._ask_at = now + AGAIN
        if self.phase == "preparing":
            self._publish_aside(self.keys.control, self._prepare_bytes)
        elif self.phase != "holding":
            self.post.ask_again()
        if self.phase in ("gathering", "holding", "joining"):
            missing = dict.fromkeys(who for _, who in self.missing_messages())
            waits_for = tuple(missing) or self.config.recorders
            waiting = Waiting(sender=PLANT, epoch=self.config.epoch, seq=self.tick, t=self.t, waits_for=waits_for)
            self._publish_aside(self.keys.control, encode(waiting))

    def _agent_gone(self, name: str, now: float) -> None:
        if self.phase in ("closing", "over"):
            return
        begun = self.phase != "gathering" and not (self.phase == "preparing" and self._roster_number == 0)
        self.reproducible = False
        self._roster_changed = True
        self._barrier.came(name)  # its message will never come
        if not begun:
            self.abort(f"{name} died before the run began", now)
        elif name in self._joining:
            self.abort(f"{name} died at t = {self.t:g} s, before it had joined", now)
        else:
            self._note(name, f"{name} died at t = {self.t:g} s; {STAYS}")
        if self.phase == "preparing":  # no agent can get ready to hear a dead one
            self._prepare(now)

    def _close_if_alone(self) -> None:
        if self.phase == "closing" and self._all_have_gone():
            self._be_over()

    def _all_have_gone(self) -> bool:
        """Whether all other tokens are gone, and the recorders that the run waits for have everything."""
        super()._all_have_gone()
        recorders = {self.keys.alive_recorder(name) for name in self.config.recorders}
        return self._tokens <= recorders and self._unacknowledged.is_empty

    # ---------------------------------------------------------------- messages

    def _on_state(self, state: State, payload: bytes, now: float) -> None:
        if self.phase != "ticking" or state.seq != self.tick or not self._barrier.awaits(state.sender):
            kind = "stale" if state.seq <= self.tick else "unexpected"
            raise RejectedError(kind, f"State({state.seq}) of {state.sender} at tick {self.tick} ({self.phase})")
        self._barrier.came(state.sender)
        self._note_state(state)
        if is_usable(self._links, state, payload, state.t, self.admission):
            self._states[state.sender] = state

    def _on_ready(self, ready: Ready, payload: bytes, now: float) -> None:
        if ready.seq != self._roster_number:
            raise RejectedError("stale", f"Ready({ready.seq}) of {ready.sender} in phase {self.phase}")
        if self.phase == "preparing":  # else it is the answer to a Prepare that was sent again
            self._barrier.came(ready.sender)
            self._barrier.renew(now)

    def _on_request(self, command: Command, payload: bytes, now: float) -> None:
        """Take a recorder's word on which Telemetry it needs next; publish again if it says the same once more."""
        name, text = command.sender, command.argument
        if command.verb != "telemetry" or name not in self._recorders_at or not (text.isascii() and text.isdigit()):
            raise RejectedError("unexpected", f'"{command.verb}" of {name}, in simulated time')
        self._recorders_at[name] = now
        self.post.last_heard[name] = command.seq, now
        again = self._unacknowledged.acknowledged(name, int(text))
        if again is not None:
            answer = Answer(sender=PLANT, epoch=self.config.epoch, seq=command.seq, t=self.t, ok=True, text=text)
            self._publish_aside(self.keys.answer(command.reply_to), encode(answer))
            for kept in again:
                self._publish_aside(self.keys.telemetry, kept)
        self._close_if_alone()

    def _publish(self, key: str, payload: bytes) -> None:
        if key == self.keys.telemetry:
            self._unacknowledged.keep(self._reporter.seq, payload)
        super()._publish(key, payload)

    def _publish_aside(self, key: str, payload: bytes) -> None:
        """Publish what depends on the time that others take: the record, the same in every run, is without it."""
        self.post.actions.append(Publish(key, payload))

    # ---------------------------------------------------------------- the roster

    def _gather(self, now: float) -> None:
        enough = len(self.members.nameplates) >= len(self.config.agents)  # else it would ask n times for all n
        if self.phase == "gathering" and enough and not self.missing_messages():
            self._reporter.collect()
            self._prepare(now)
            assert set(self._roster) == set(self.config.agents)

    def _prepare(self, now: float) -> None:
        self._roster = tuple(name for name in self._everyone if self.members.instance(name))
        self._roster_number += 1
        self._roster_changed = False
        self.phase = "preparing"
        self._barrier.wait_for(dict.fromkeys(self._roster, f"Ready({self._roster_number})"), now)
        prepare = Prepare(
            sender=PLANT,
            epoch=self.config.epoch,
            seq=self._roster_number,
            t=self.t,
            roster=self._roster,
            instances=tuple(self.members.instance(name) for name in self._roster),
        )
        self._prepare_bytes, self._ask_at = encode(prepare), now + AGAIN
        self._publish(self.keys.control, self._prepare_bytes)

    def _let_leave_and_join(self, now: float) -> None:
        leave, join, die = self._schedule.pop(self.tick, TickActions())
        when = f"at t = {self.t:g} s, as the scenario says"
        for name in leave:
            self._dismiss(name, f"{name} leaves {when}")
            self._connect(name, False, now)
        for name in die:
            self._dismiss(name, f"{name} dies {when}; {STAYS}")
        joining = tuple(name for name in join if not self.members.instance(name))
        for name in joining:
            self._note(name, f"{name} joins {when}")
        if joining and not self.outcome:
            self._joining, self.phase = joining, "joining"
            self._barrier.renew(now)
            self._ask_at = now + AGAIN
            self._report(final=False, missing_agents=joining)

    def _dismiss(self, name: str, text: str) -> None:
        """Send an agent's process, if there is one, a stop request; it takes part no more."""
        self._note(name, text)
        self._roster_changed = True
        instance = self.members.instance(name)
        if instance:
            self.members.dismiss(name)
            self.stop(self.keys.stop_request(name, instance), text)

    def _note(self, name: str, text: str) -> None:
        self._note_event("roster", name, text)

    def _connect(self, name: str, on: bool, now: float) -> None:
        if not self.outcome and self._operate(lambda: self._plant.connect(name, on), now):
            self._reporter.collect()

    # ---------------------------------------------------------------- ticks

    def work(self, now: float) -> bool:
        """Do the next roster or tick if no message is missing; return whether anything was done."""
        if self.phase not in ("preparing", "ticking", "joining", "holding") or not self._barrier.is_open:
            return False
        if self.phase == "holding" and self._unacknowledged.is_full:
            return False
        ticked = self.phase == "ticking"
        if ticked:
            self._finish_tick(now)
            if self.phase == "ticking":
                self._let_leave_and_join(now)
        if self.phase == "joining":
            if self.missing_messages():
                return ticked
            joined, self._joining, self._roster_changed = self._joining, (), True
            for name in joined:  # their inverters are on the network, at no load
                self._connect(name, True, now)
        if self.phase in ("preparing", "ticking", "joining", "holding"):
            if self._roster_changed:
                self._prepare(now)
            elif self._unacknowledged.is_full:
                self.phase, self._ask_at = "holding", now + AGAIN
                self._barrier.rest()
            else:
                self._grant(now)
        return True

    def _grant(self, now: float) -> None:
        self.phase, self._ask_at = "ticking", inf
        self._barrier.wait_for(dict.fromkeys(self._roster, f"State({self.tick})"), now)
        for measurement in self._measurements():
            self._publish(self._measurement_keys[measurement.to], encode(measurement))
        if self.tick == 0:
            self._note_node_faults()
            self._report(final=False)

    def _measurements(self) -> Iterator[Measurement]:
        t, tick, epoch = self.t, self.tick, self.config.epoch
        readings = self._plant.measure()
        for name in self._roster:
            yield measurement_of(name, readings[name], epoch=epoch, tick=tick, t=t)

    def _finish_tick(self, now: float) -> None:
        if self._stops_for_a_law(now):
            return
        if self._tick_traffic is not None:
            self._tick_traffic.ticked(self.tick)
        self._states.update((state.sender, state) for state in self._late_states(self.t))
        for name in self._roster:
            if (state := self._states.get(name)) is not None:
                self._plant.hold(name, state.P_set, state.V_set)
        self._states = {}
        if not self._operate(self._plant.advance, now):
            return
        self.tick += 1
        self._reporter.collect()
        self._note_node_faults()
        if self.tick == self._end_tick:
            self._close("end of the scenario", now)
        elif self.tick % TELEMETRY_TICKS == 0:
            self._report(final=False)
            self._report_journal()
            if self.tick % REPORT_TICKS == 0:
                self._report_links()

    # ---------------------------------------------------------------- telemetry and the end

    def _report(self, *, final: bool, missing_agents: tuple[str, ...] = ()) -> None:
        messages = self._reporter.report(
            self.t,
            final=final,
            outcome=self.outcome,
            reproducible=self.reproducible,
            awaited=missing_agents,
            others=self._unacknowledged.others(self._reporter.seq),
        )
        for message in messages:
            self._send(message)

    def _close(self, reason: str, now: float) -> None:
        if self._tick_traffic is not None:
            self._tick_traffic.ticked(self.tick)
        self._tell_the_end(reason)
        self.phase, self._ask_at = "closing", inf
        self._barrier.wait_for({}, now)
        self._barrier.deadline = now + CLOSING
        self._close_if_alone()

    def _be_over(self) -> None:
        self._send_the_last()
        self.phase = "over"
        self._barrier.rest()
