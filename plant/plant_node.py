"""The plant as a node: the common part of both kinds of time. Pure.

It meets the agents by their tokens and nameplates, refuses those that cannot take part, passes on the accounts of
emulated links, and sends telemetry to recorders. Its subclasses decide when the plant advances.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.telemetry_reporter import Reporter
from gridpeers.wire.codec import encode
from gridpeers.wire.journal import JournalBuffer
from gridpeers.wire.keys import check_name
from gridpeers.wire.links import Links
from gridpeers.wire.membership import arrived
from gridpeers.wire.messages import PLANT, Journal, LinkReport, Nameplate, PlantEvent, State, Stop, Telemetry
from gridpeers.wire.post import Post
from gridpeers.wire.timing import ticks_until, time_of
from gridpeers.wire.wording import printable


class TickActions(NamedTuple):
    leave: tuple[str, ...] = ()  # inverters whose agents leave
    join: tuple[str, ...] = ()  # inverters whose agents join
    die: tuple[str, ...] = ()  # inverters whose agents die


def agent_schedule(config: PlantConfig, inverters: tuple[str, ...]) -> dict[int, TickActions]:
    """Return the scheduled joins, leaves and deaths of a run, by tick.

    ValueError if an action names no inverter of the plant, or its time is no tick after 0.
    """
    at: dict[int, TickActions] = {}
    for action in config.schedule:
        if action.inverter not in inverters:
            raise ValueError(f'schedule: no inverter "{action.inverter}"; inverters are {", ".join(inverters)}')
        tick = round(action.t / config.T_c)
        if tick < 1 or abs(tick * config.T_c - action.t) > 1e-9 * max(1.0, action.t):
            raise ValueError(
                f"schedule: {action.inverter} must {action.action} at a positive multiple of the control period "
                f"{config.T_c:g} s, got {action.t:g} s"
            )
        actions = at.get(tick, TickActions())
        at[tick] = actions._replace(**{action.action: (*getattr(actions, action.action), action.inverter)})
    return at


CLOSING = 2.0  # longest wait (s) for the other nodes to close
MOST_RECORDERS = 20  # recorders that are noted beside those that the run waits for: anybody may hold tokens
STAYS = "its inverter stays on primary droop at its last set-points"  # state of the inverter whose agent has died
IDLE = "; its agent is idle, its inverter stays on primary droop"  # end of the event of a law that failed


class PlantNode:
    def __init__(self, config: PlantConfig, plant: PlantLike, links: Links | None) -> None:
        post = self.post = Post(PLANT, config.run, config.epoch)
        post.on_nameplate = self._on_nameplate
        self.keys, self.members, self.admission, self.rejects = post.keys, post.members, post.admission, post.rejects
        self.name, self.routes, self.watched = PLANT, post.routes, post.keys.any_alive
        self.take_actions, self.take_rejects = post.take_actions, post.take_rejects
        self.is_known, self.lost = post.is_known, post.lost
        for name in config.agents:
            check_name("agents", name)
            if name not in plant.inverters:
                raise ValueError(f'agents: no inverter "{name}"; inverters are {", ".join(plant.inverters)}')
        self.outcome = ""  # why the run broke; empty while it is sound
        self.cause: Exception | None = None  # error of the plant that broke the run, if any
        self.tick = 0  # k: the plant is at k T_c
        self.config = config
        self._inverters = tuple(plant.inverters)
        self._links = links
        self._end_tick = None if config.end is None else ticks_until(config.end, config.T_c)
        self._recorders: set[str] = set()
        self._tokens: set[str] = set()
        """Present tokens of agents and recorders that take part; while it closes, also of agents told to stop."""
        self._schedule = agent_schedule(config, plant.inverters)
        self._reporter = Reporter(config.epoch, plant)
        if config.record != "physics":
            post.journal = JournalBuffer()
        self._awaits_journals = post.journal is not None and config.clock == "wall"
        """Whether agents send the end of their journals when they close."""
        self._last_due = False  # whether the run has ended and the last telemetry is still to be sent
        self._failed_laws: dict[str, str] = {}  # by agent, why its law failed

    @property
    def token(self) -> str:
        return self.keys.alive_plant(self.config.epoch)

    @property
    def tokens(self) -> tuple[str, ...]:
        return (self.token,)

    @property
    def finished(self) -> bool:
        raise NotImplementedError

    def received(self, key: str, payload: bytes, now: float) -> None:
        if not self.finished:
            self.post.received(key, payload, now)

    def use_links(self, links: Links) -> None:
        self._links = links

    @property
    def t(self) -> float:
        return time_of(self.tick, self.config.T_c)

    # ---------------------------------------------------------------- liveliness

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared; of two processes of one name the first takes part."""
        match self.post.token(key, now, appeared=True):
            case ("alive", "recorder", name) if self._has_room(name):
                self._tokens.add(key)
                self._recorders.add(name)
                self._recorder_came(name, now)
            case ("alive", "recorder", name):
                self.rejects.add("excess", key, f"the token of recorder {name}; {MOST_RECORDERS} others hold tokens")
            case ("alive", "agent", name, instance):
                refusal = self._refusal(name, instance)
                if refusal:
                    self._refuse(name, instance, refusal, now)
                elif self.post.process_came(name, instance):
                    self._tokens.add(key)

    def vanished(self, key: str, now: float) -> None:
        self._tokens.discard(key)
        match self.post.token(key, now, appeared=False):
            case ("alive", "recorder", name):
                self._recorders.discard(name)
                self._recorder_gone(name)
            case ("alive", "agent", name, instance) if self.post.process_gone(name, instance):
                self._agent_gone(name, now)
        self._close_if_alone()

    def _on_nameplate(self, instance: str, nameplate: Nameplate, first: bool, now: float) -> None:
        if first:
            self._met(nameplate, now)

    def _met(self, nameplate: Nameplate, now: float) -> None:
        raise NotImplementedError

    def _publish(self, key: str, payload: bytes) -> None:
        self.post.publish(key, payload)

    def _has_room(self, recorder: str) -> bool:
        """Whether a recorder is needed, noted already, or one of few."""
        known = recorder in self._recorders or recorder in self.config.recorders
        return known or len(self._recorders) < MOST_RECORDERS

    def _is_taken(self, name: str, instance: str) -> bool:
        return self.members.instance(name) not in ("", instance)

    def _refusal(self, name: str, instance: str) -> str:
        """Return the reason why a process cannot take part; empty if it can."""
        raise NotImplementedError

    def _refuse(self, name: str, instance: str, reason: str, now: float) -> None:
        self.stop(self.keys.stop_request(name, instance), reason, refused=True)

    def _recorder_came(self, name: str, now: float) -> None:
        raise NotImplementedError

    def _recorder_gone(self, name: str) -> None:
        """Note that a recorder's token is gone."""

    def _agent_gone(self, name: str, now: float) -> None:
        raise NotImplementedError

    def _close_if_alone(self) -> None:
        """End the wait for the other nodes to close, once all have gone."""
        raise NotImplementedError

    # ---------------------------------------------------------------- the plant itself

    def abort(self, reason: str, now: float) -> None:
        raise NotImplementedError

    def _operate(self, operation: Callable[[], object], now: float) -> bool:
        """Call an operation of the plant; abort the run and return False if it raises RuntimeError."""
        try:
            operation()
        except RuntimeError as error:
            self.cause = error
            self.abort(str(error), now)
            return False
        return True

    # ---------------------------------------------------------------- events and reports

    def _note_node_faults(self) -> None:
        """Note among the events which agents began or ended to lie by the plant's time."""
        for name, text in () if self._links is None else self._links.node_events(self.t):
            self._note_event("link", name, text)

    def _note_event(self, kind: Literal["law", "link", "roster", "warning"], subject: str, text: str) -> None:
        self._reporter.note(PlantEvent(t=self.t, kind=kind, subject=subject, text=text))

    def stop(self, key: str, reason: str, *, refused: bool = False) -> None:
        epoch = self.config.epoch
        stop = Stop(sender=PLANT, epoch=epoch, seq=self.tick, t=self.t, reason=printable(reason), refused=refused)
        self._publish(key, encode(stop))

    def _note_state(self, state: State) -> None:
        if state.fault:
            self._failed_laws.setdefault(state.sender, state.fault)
            self._note_event("law", state.sender, f"{state.sender}: {state.fault}{IDLE}")
        if state.quiet:
            self._reporter.note_quiet(self.t)

    def _stops_for_a_law(self, now: float) -> bool:
        """End the run if a law has failed and the scenario wants it so; return whether it ends."""
        failed = sorted(self._failed_laws, key=self._inverters.index)
        if not failed or self.config.on_law_failure != "stop":
            return False
        more = f", and {len(failed) - 1} more" if len(failed) > 1 else ""
        why = f"{failed[0]}: {self._failed_laws[failed[0]]}{more}"
        self.abort(printable(f"ended at t = {self.t:g} s, as on_law_failure says: {why}"), now)
        return True

    def _late_states(self, now: float) -> Iterable[State]:
        """Return the usable states that the emulated links have delivered by now (s of run time)."""
        return (state for state in arrived(self._links, now, self.rejects, self.admission) if isinstance(state, State))

    def _on_report(self, report: LinkReport, payload: bytes, now: float) -> None:
        """Pass on the account of an agent's links; acknowledge the last one, so that the agent closes."""
        self._publish(self.keys.telemetry, payload)
        if report.final:
            self.stop(self.keys.stop_request(report.sender, report.instance), "its report is here")

    def _on_journal(self, journal: Journal, payload: bytes, now: float) -> None:
        self._publish(self.keys.telemetry, payload)

    def _report_journal(self, *, last: bool = False) -> None:
        for part in self.post.take_journal(self.t):
            self._publish(self.keys.telemetry, encode(part))

    def _report_links(self, *, last: bool = False) -> None:
        for part in self.post.take_link_reports(self._links, t=self.t, last=last):
            self._publish(self.keys.telemetry, encode(part))

    def _report(self, *, final: bool, missing_agents: tuple[str, ...] = ()) -> None:
        """Send telemetry, with the names of agents to start."""
        raise NotImplementedError

    def _send(self, message: Telemetry) -> None:
        self._publish(self.keys.telemetry, encode(message))

    # ---------------------------------------------------------------- the end

    def _tell_the_end(self, reason: str) -> None:
        """Let all nodes close. The last telemetry waits for the agents' accounts of emulated links, and journals."""
        self._last_due = True
        if self._links is None and not self._awaits_journals:
            self._send_the_last()
        self.stop(self.keys.control, reason)

    def _all_have_gone(self) -> bool:
        """Return whether all tokens are gone; send the last telemetry once those of the agents are."""
        if not any(self.keys.parts(token)[1] == "agent" for token in self._tokens):
            self._send_the_last()
        return not self._tokens

    def _send_the_last(self) -> None:
        if self._last_due:
            self._last_due = False
            self._report_journal(last=True)
            self._report_links(last=True)
            self._report(final=True)
