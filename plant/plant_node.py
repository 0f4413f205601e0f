"""The plant as a node: what it does alike under both kinds of time. Pure.

It meets the agents by their tokens and nameplates and refuses those that cannot take part, holds the set-points that
the links let through, passes on what emulated links did, and tells recorders. When it advances,
`plant.lockstep_plant` and `plant.realtime.realtime_plant` decide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import inf
from typing import Literal

from plant.agent_schedule import AgentSchedule
from plant.plant_config import PlantConfig
from plant.plant_interface import PlantLike
from plant.telemetry_reporter import Reporter
from wire.clock import ticks_until, time_of
from wire.codec import encode
from wire.keys import check_name
from wire.links import Links, arrived
from wire.messages import PLANT, LinkReport, Pacing, PlantEvent, State, Stop
from wire.node import Node
from wire.printable import printable

CLOSING = 2.0
"""Longest wait for the others to close (s)."""

STAYS = "its inverter stays on primary droop at its last set-points"
"""What becomes of the inverter of an agent that dies."""


class PlantNode(Node):
    """The plant in a run.

    Parameters
    ----------
    config : PlantConfig
        Names the agents and recorders to wait for, the control period and the end.
    plant : PlantLike
        The plant at t = 0.
    links : Links or None
        What the links to the plant do to its messages.
    rate : float, optional
        Most messages of one sender per s of run time; see `wire.admission`.
    """

    def __init__(self, config: PlantConfig, plant: PlantLike, links: Links | None, rate: float = inf) -> None:
        super().__init__(PLANT, config.run, rate)
        for name in config.agents:
            check_name("agents", name)
            if name not in plant.inverters:
                raise ValueError(f'agents: no inverter "{name}"; inverters are {", ".join(plant.inverters)}')
        self.outcome = ""
        """Why the run broke; empty while it goes well."""
        self.cause: Exception | None = None
        """What the plant raised, if that broke the run."""
        self.tick = 0
        """k: the plant stands at k T_c."""
        self.config = config
        self._links = links
        self._end_tick = None if config.end is None else ticks_until(config.end, config.T_c)
        self._recorders: set[str] = set()
        self._tokens: set[str] = set()
        """All tokens of agents and recorders that are there now, refused ones too."""
        self._schedule = AgentSchedule(config, plant.inverters)
        self._reporter = Reporter(config.epoch, plant)
        self._last_due = False
        """Whether the last telemetry is yet to be sent, though the run has ended."""

    @property
    def token(self) -> str:
        """Key of the plant's liveliness token."""
        return self.keys.alive_plant(self.config.epoch)

    @property
    def t(self) -> float:
        """Run time the plant stands at (s)."""
        return time_of(self.tick, self.config.T_c)

    # ---------------------------------------------------------------- liveliness

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared; of two processes of one name the first takes part."""
        match self.keys.parts(key):
            case ("alive", "recorder", name):
                self._tokens.add(key)
                self._recorders.add(name)
                self._recorder_came(name, now)
            case ("alive", "agent", name, instance):
                self._tokens.add(key)
                refusal = self._refusal(name, instance)
                if refusal:
                    self._refuse(name, instance, refusal)
                else:
                    self.members.appeared(name, instance)
                    self._ask(name, instance)

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        self._tokens.discard(key)
        match self.keys.parts(key):
            case ("alive", "recorder", name):
                self._recorders.discard(name)
                self._recorder_gone(name)
            case ("alive", "agent", name, instance) if self._forget_process(name, instance):
                self._agent_gone(name, now)
        self._close_if_alone()

    def _is_taken(self, name: str, instance: str) -> bool:
        """Whether another process speaks for a name."""
        return self.members.instance(name) not in ("", instance)

    def _refusal(self, name: str, instance: str) -> str:
        """Give the reason why a process cannot take part; empty if it can."""
        raise NotImplementedError

    def _refuse(self, name: str, instance: str, reason: str) -> None:
        """Tell a process that it cannot take part."""
        self.stop(self.keys.stop_request(name, instance), reason, refused=True)

    def _recorder_came(self, name: str, now: float) -> None:
        raise NotImplementedError

    def _recorder_gone(self, name: str) -> None:
        """Note that a recorder's token is gone."""

    def _agent_gone(self, name: str, now: float) -> None:
        """Note that the process which took part for a name is gone."""
        raise NotImplementedError

    def _close_if_alone(self) -> None:
        """End the wait for the others to close, if that is over."""
        raise NotImplementedError

    # ---------------------------------------------------------------- the plant itself

    def abort(self, reason: str, now: float) -> None:
        """End the run because something went wrong."""
        raise NotImplementedError

    def _operate(self, operation: Callable[[], object], now: float) -> bool:
        """Have the plant do something; abort the run and return False if the network has no solution."""
        try:
            operation()
        except RuntimeError as error:
            self.cause = error
            self.abort(str(error), now)
            return False
        return True

    # ---------------------------------------------------------------- what is told

    def _note_event(self, kind: Literal["law", "link", "roster", "warning"], subject: str, text: str) -> None:
        """Note an event at the plant's time."""
        self._reporter.note(PlantEvent(t=self.t, kind=kind, subject=subject, text=text))

    def stop(self, key: str, reason: str, *, refused: bool = False) -> None:
        """Tell one agent, or all, to close."""
        epoch = self.config.epoch
        stop = Stop(sender=PLANT, epoch=epoch, seq=self.tick, t=self.t, reason=printable(reason), refused=refused)
        self._publish(key, encode(stop))

    def _note_state(self, state: State) -> None:
        """Note what a state says beside its set-points: a law that has failed, or that does not tell its neighbours."""
        if state.fault:
            text = f"{state.sender}: {state.fault}; its agent stands still, its inverter stays on primary droop"
            self._note_event("law", state.sender, text)
        if state.quiet:
            self._reporter.note_quiet(self.t)

    def _late_states(self, now: float) -> Iterable[State]:
        """States that the emulated links have let through by now (s of run time) and that are of use."""
        return (state for state in arrived(self._links, now, self.rejects, self.admission) if isinstance(state, State))

    def _on_report(self, report: LinkReport, payload: bytes, now: float) -> None:
        """Pass on what an agent's links did; it closes once it knows that its last report is here."""
        self._publish(self.keys.telemetry, payload)
        if report.final:
            self.stop(self.keys.stop_request(report.sender, report.instance), "its report is here")

    def _report_links(self, *, last: bool = False) -> None:
        """Send what the emulated links to the plant did since the last report."""
        self._publish_link_reports(self.keys.telemetry, self._links, self.config.epoch, t=self.t, last=last)

    def _report(self, *, final: bool, missing_agents: tuple[str, ...] = ()) -> None:
        """Send telemetry; name the agents that are to be started."""
        raise NotImplementedError

    def _telemetry(
        self,
        *,
        final: bool,
        reproducible: bool,
        missing_agents: tuple[str, ...] = (),
        pacing: Pacing | None = None,
        impaired: tuple[str, ...] = (),
        others: int = 0,
    ) -> None:
        """Send rows and events."""
        messages = self._reporter.report(
            self.t,
            final=final,
            outcome=self.outcome,
            reproducible=reproducible,
            pacing=pacing,
            awaited=missing_agents,
            impaired=impaired,
            others=others,
        )
        for message in messages:
            self._publish(self.keys.telemetry, encode(message))

    # ---------------------------------------------------------------- the end

    def _tell_the_end(self, reason: str) -> None:
        """Have everybody close. The last telemetry waits for what the agents have to say of emulated links."""
        self._last_due = True
        if self._links is None:
            self._send_the_last()
        self.stop(self.keys.control, reason)

    def _all_have_gone(self) -> bool:
        """Whether all tokens have; once those of the agents have, the last telemetry is sent."""
        if not any(self.keys.parts(token)[1] == "agent" for token in self._tokens):
            self._send_the_last()
        return not self._tokens

    def _send_the_last(self) -> None:
        """Send the last telemetry, if it has not been sent."""
        if self._last_due:
            self._last_due = False
            self._report_links(last=True)
            self._report(final=True)
