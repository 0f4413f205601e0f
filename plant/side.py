"""What the plant's side of simulated and of wall-clock time have in common: its keys, its agents, its actions. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from plant.config import PlantConfig
from plant.interface import PlantLike
from plant.reporting import Reporter
from plant.schedule import Schedule
from wire.actions import Action, Publish, Say
from wire.clock import ticks_until, time_of
from wire.codec import RejectedError, Rejects, encode
from wire.keys import Keys, check_name
from wire.links import Links, arrived
from wire.messages import PLANT, AnyMessage, LinkReport, Nameplate, Pacing, State, Stop
from wire.printable import printable

CLOSING = 2.0
"""Longest wait for the others to close (s)."""


LINK_TICKS = 100
"""What emulated links to the plant did is sent every so many ticks."""


class Side:
    """The plant on a wire.

    Parameters
    ----------
    config : PlantConfig
        Names the agents and recorders to wait for, the control period and the end.
    plant : PlantLike
        The plant at t = 0.
    links : Links or None
        What the links to the plant do to its messages.
    """

    def __init__(self, config: PlantConfig, plant: PlantLike, links: Links | None) -> None:
        for name in config.agents:
            check_name("agents", name)
            if name not in plant.inverters:
                raise ValueError(f'agents: no inverter "{name}"; inverters are {", ".join(plant.inverters)}')
        self.keys = Keys(config.run)
        self.rejects = Rejects(PLANT)
        self.outcome = ""
        """Why the run broke; empty while it goes well."""
        self.cause: RuntimeError | None = None
        """What the plant raised, if that broke the run."""
        self.tick = 0
        """k: the plant stands at k T_c."""
        self.config = config
        self.instances: dict[str, str] = {}
        """The one instance of each agent that takes part."""
        self.plates: dict[str, Nameplate] = {}
        self._links = links
        self._ticks = None if config.end is None else ticks_until(config.end, config.T_c)
        self._actions: list[Action | Say] = []
        self._recorders: set[str] = set()
        self._tokens: set[str] = set()
        """All tokens of agents and recorders that are there now, refused ones too."""
        self._schedule = Schedule(config, plant.inverters)
        self._reporter = Reporter(config.incarnation, plant)
        self._last_due = False
        """Whether the last telemetry is yet to be sent, though the run has ended."""
        self._set_by: dict[str, int] = {}
        """Number of the last state of each agent that a link let through."""

    @property
    def token(self) -> str:
        """Key of the plant's liveliness token."""
        return self.keys.alive_plant

    @property
    def watched(self) -> str:
        """Key expression of the tokens to watch."""
        return self.keys.any_alive

    @property
    def t(self) -> float:
        """Run time the plant stands at (s)."""
        return time_of(self.tick, self.config.T_c)

    def take_actions(self) -> list[Action | Say]:
        """What is to be done now, in this order."""
        actions, self._actions = self._actions, []
        return actions

    def stop(self, key: str, reason: str, *, refused: bool = False) -> None:
        """Tell one agent, or all, to close."""
        incarnation = self.config.incarnation
        stop = Stop(
            sender=PLANT, incarnation=incarnation, seq=self.tick, t=self.t, reason=printable(reason), refused=refused
        )
        self._publish(key, encode(stop))

    def _publish(self, key: str, payload: bytes) -> None:
        self._actions.append(Publish(key, payload))

    def _check_sender(self, expected: str, message: AnyMessage) -> None:
        name, life = message.sender, message.incarnation
        if name != expected:
            raise RejectedError("foreign", f"sender {name}, {expected} was expected")
        plate = self.plates.get(name)
        if plate is None or life != plate.incarnation:
            raise RejectedError("ghost", f"life {life} of {name} does not take part")

    def _news(self, now: float) -> Iterable[State]:
        """States that the emulated links have let through by now (s of run time) and that are news."""
        for state in arrived(self._links, now, self.rejects):
            if isinstance(state, State) and state.seq > self._set_by.get(state.sender, -1):
                self._set_by[state.sender] = state.seq
                yield state

    def _report(self, *, final: bool, awaited: tuple[str, ...] = ()) -> None:
        raise NotImplementedError

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

    def _forward(self, report: LinkReport, payload: bytes) -> None:
        """Pass on what an agent's links did; it closes once it knows that its last report is here."""
        self._publish(self.keys.telemetry, payload)
        if report.final:
            try:
                check_name("instance", report.instance)
            except ValueError as error:
                raise RejectedError("garbled", str(error)) from None
            self.stop(self.keys.dismissal(report.sender, report.instance), "its report is here")

    def _report_links(self, *, last: bool = False) -> None:
        """Send what the emulated links to the plant did of late."""
        for data in () if self._links is None else self._links.report(last=last):
            report = LinkReport(sender=PLANT, incarnation=self.config.incarnation, seq=0, t=self.t, data=data)
            self._publish(self.keys.telemetry, encode(report))

    def _telemetry(
        self,
        *,
        final: bool,
        reproducible: bool,
        awaited: tuple[str, ...] = (),
        pacing: Pacing | None = None,
        impaired: tuple[str, ...] = (),
    ) -> None:
        """Send rows and events, and who is to be started."""
        messages = self._reporter.report(
            self.t,
            final=final,
            outcome=self.outcome,
            reproducible=reproducible,
            pacing=pacing,
            awaited=awaited,
            impaired=impaired,
        )
        for message in messages:
            self._publish(self.keys.telemetry, encode(message))
