"""The agents and recorders of a plant under real time: they come, leave, die and are refused. Pure.

A token and a nameplate: the agent's inverter is put on the network, if it is not there, and measurements are sent to
the agent. `Leave`: its inverter is taken off. A token gone without `Leave`: the agent died, and its inverter stays on
primary droop at its last set-points. An agent that leaves by the scenario is asked to. Telemetry reports, once, that an
agent that joins is missing, and the run goes on meanwhile.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant
from gridpeers.plant.plant_node import STAYS, PlantNode, TickActions
from gridpeers.plant.realtime.recorder_feed import KEPT_BYTES, KEPT_BYTES_RECORDED, RecorderFeed
from gridpeers.plant.realtime.run_commands import LinkCommandSender
from gridpeers.plant.realtime.silence_detector import SilenceDetector
from gridpeers.wire.links import Links, is_usable
from gridpeers.wire.membership import FASTER
from gridpeers.wire.messages import AgentStatus, Journal, Leave, LinkAcknowledgement, LinkReport, Nameplate, State
from gridpeers.wire.node import Route
from gridpeers.wire.timing import RateLimit, Timer
from gridpeers.wire.traffic import TimedTraffic

Phase = Literal["gathering", "running", "closing", "over"]

REFUSALS = 20  # refused processes that are logged: anybody may hold tokens

REFUSAL_INTERVAL = 0.1
"""Time (s, wall) after which one more process is told that it is refused, once so many have been told at once: each
needs a publisher of its own, a millisecond or two in which the plant does not step."""

AGAIN = 1.0
"""Time (s, wall) between two questions for the nameplates that have not come: a question dies with its link."""

HEARD = 1.0  # time (s, wall) after its last state for which an agent is on the roster, as one that the plant hears


class LivePlantNode(PlantNode):
    """The plant in a run under real time, but for its steps; parameters as of `PlantNode`."""

    def __init__(self, config: PlantConfig, plant: LivePlant, links: Links | None) -> None:
        super().__init__(config, plant, links, rate=FASTER / config.T_c)
        self.phase: Phase = "gathering"
        self.plant = plant
        self.link_commands = LinkCommandSender(config.epoch, self.keys, links, self._publish)
        publish, kept = (
            partial(super()._publish, self.keys.telemetry),
            KEPT_BYTES if self.journal is None else KEPT_BYTES_RECORDED,
        )
        self.recorder_feed = RecorderFeed(config.recorders, publish, kept)
        self._states: dict[str, State] = {}  # states that the links let through and that are not held yet
        self._state_at: dict[str, float] = {}
        """Time (s, driver's clock) at which the last state of each agent came off the wire."""
        self._silence = SilenceDetector(config.max_age, config.T_c, config.T_c / config.speed)
        self._ask_timer = Timer(AGAIN, 0.0)
        self._refusals = 0
        self._refusal_limit = RateLimit(REFUSALS, REFUSAL_INTERVAL)
        self.timed: TimedTraffic | None = None  # notes the plant's messages and tokens; None if nobody records them
        if self.journal is not None:
            arrivals = config.record == "all"
            self.timed = self.traffic = TimedTraffic(self.keys, self.journal, arrivals=arrivals, whole=True)
        keys = self.keys
        for name in plant.inverters:
            self.routes[keys.state(name)] = self.routes[keys.set_points(name)] = Route(name, (State,), self._on_state)
            self.routes[keys.status(name)] = Route(name, (AgentStatus,), self._on_status, early=True)
            self.routes[keys.leave(name)] = Route(name, (Leave,), self._on_leave)
            self.routes[keys.report(name)] = Route(name, (LinkReport,), self._on_report)
            self.routes[keys.journal(name)] = Route(name, (Journal,), self._on_journal)
            self.routes[keys.link_acknowledgement(name)] = Route(name, (LinkAcknowledgement,), self._on_link_answer)

    @property
    def publications(self) -> tuple[str, ...]:
        inverters = self.plant.inverters
        each = (*map(self.keys.measurement, inverters), *map(self.keys.link_request, inverters))
        return self.keys.control, self.keys.telemetry, *each

    def _begin(self, now: float) -> None:
        raise NotImplementedError

    # ---------------------------------------------------------------- tokens and nameplates

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared; an agent that comes after the end has missed the `Stop` to all."""
        match self.keys.parts(key):
            case ("alive", "agent", name, instance) if self.phase == "closing":
                if self._may_tell(name, instance, now):
                    self._tokens.add(key)
                    self.stop(self.keys.stop_request(name, instance), self.outcome or "the run has ended")
            case _:
                super().appeared(key, now)

    def _refusal(self, name: str, instance: str) -> str:
        if name not in self.plant.inverters:
            return f"{name}: no inverter of this name; inverters are {', '.join(self.plant.inverters)}"
        if self._is_taken(name, instance):
            reason = f"{name}: another agent of this name takes part in run {self.config.run} already; stop it"
            return f"{reason} first (gridpeers stop {name}), or give this one another name"
        return ""

    def _refuse(self, name: str, instance: str, reason: str, now: float) -> None:
        if not self._may_tell(name, instance, now):
            return
        self._refusals += 1
        if self._refusals <= REFUSALS:
            self._say(f"refused {reason}" + ("; further refusals are not logged" * (self._refusals == REFUSALS)))
        super()._refuse(name, instance, reason, now)

    def _may_tell(self, name: str, instance: str, now: float) -> bool:
        """Return whether a process is told that it cannot take part; count it if too many are."""
        if self._refusal_limit.admit("refused", now) is not None:
            return True
        text = f"a token of {name}, one of too many to be told that they are refused"
        self.rejects.add("excess", self.keys.alive_agent(name, instance), text)
        return False

    def _ask_again(self, now: float) -> None:
        if now >= self._ask_timer.due:
            self._ask_timer.take(now)
            for name, instance in self.members.next_unmet():
                self._ask(name, instance)

    def _recorder_came(self, name: str, now: float) -> None:
        if news := self.recorder_feed.came(name):
            self._say(news)
        self._gather(now)

    def _recorder_gone(self, name: str) -> None:
        if self.phase == "running" and (news := self.recorder_feed.gone(name)):
            self._say(news)

    def _met(self, nameplate: Nameplate, now: float) -> None:
        name = nameplate.sender
        if self.phase not in ("gathering", "running"):
            return
        self._silence.joined(name)
        self._connect(name, True, now)
        self._note(name, f"{name} joined")
        self.link_commands.send(self.members.nameplates, now)
        self._gather(now)

    def _agent_gone(self, name: str, now: float) -> None:
        self._forget(name)
        if self.phase in ("gathering", "running"):
            self._note(name, f"{name} died; {STAYS}")

    def _forget(self, name: str) -> None:
        self.link_commands.forget(name)
        self._silence.forget(name)
        self._state_at.pop(name, None)
        self._states.pop(name, None)

    @property
    def absent(self) -> tuple[str, ...]:
        """Agents of the configuration that do not take part."""
        return tuple(name for name in self.config.agents if name not in self.members.nameplates)

    def _heard(self, now: float) -> tuple[str, ...]:
        """Return the agents whose last state came less than `HEARD` ago."""
        return tuple(name for name in self.plant.inverters if now - self._state_at.get(name, now - HEARD) < HEARD)

    def _gather(self, now: float) -> None:
        """Begin, if all are there."""
        if self.phase == "gathering" and not self.absent and self._recorders >= set(self.config.recorders):
            self._begin(now)

    # ---------------------------------------------------------------- messages

    def _on_state(self, state: State, payload: bytes, now: float) -> None:
        self.admission.take(state)
        self._state_at[state.sender] = now
        self._silence.heard(state.sender, failed=bool(state.fault))
        self._note_state(state)
        if is_usable(self._links, state, payload, now * self.config.speed, self.admission):
            self._states[state.sender] = state

    def _on_status(self, status: AgentStatus, payload: bytes, now: float) -> None:
        if status.sender in self.members.nameplates:  # one comes before its nameplate now and then
            self.admission.check(status)
            self._silence.reported(status)

    def _on_link_answer(self, answer: LinkAcknowledgement, payload: bytes, now: float) -> None:
        self.link_commands.answered(answer)

    def _on_leave(self, leave: Leave, payload: bytes, now: float) -> None:
        name = leave.sender
        instance = self.members.instance(name)
        self.stop(self.keys.stop_request(name, instance), f"{name} has left")
        self._forget_process(name, instance)
        self._forget(name)
        if self.phase in ("gathering", "running"):
            self._connect(name, False, now)
            self._note(name, f"{name} left; its inverter is off the network")

    def _connect(self, name: str, on: bool, now: float) -> None:
        """Put an inverter on the network, or take it off."""
        self._operate(lambda: self.plant.connect(name, on), now)

    def _let_leave_and_join(self) -> None:
        """Ask the agents that leave at this tick by the scenario to do so, and report those that are to be started."""
        leave, join, _ = self._schedule.pop(self.tick, TickActions())  # in real time an agent dies as a process
        for name in leave:
            instance = self.members.instance(name)
            if instance:
                reason = f"{name} leaves at t = {self.t:.2f} s, as the scenario says"
                self.stop(self.keys.stop_request(name, instance), reason)
                self._say(reason)
        if join:
            self._say(f"{', '.join(join)} may join from t = {self.t:.2f} s on, as the scenario says")
            self._report(final=False, missing_agents=join)

    def _note(self, subject: str, text: str) -> None:
        self._note_event("roster", subject, f"{text}, at t = {self.t:.2f} s")
        self._say(f"{text}, at t = {self.t:.2f} s")

    def _publish(self, key: str, payload: bytes) -> None:
        if key == self.keys.telemetry:
            self.recorder_feed.publish(self._reporter.seq, payload)
        else:
            super()._publish(key, payload)
