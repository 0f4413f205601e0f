"""Base of the plant's endpoint in both kinds of time: its keys, its agents and its reports. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from math import inf

from plant.config import PlantConfig
from plant.interface import PlantLike
from plant.reporting import Reporter
from plant.schedule import Schedule
from wire.actions import Fetch
from wire.admission import is_news
from wire.clock import ticks_until, time_of
from wire.codec import RejectedError, encode
from wire.endpoint import Endpoint, Route
from wire.keys import check_name
from wire.links import Links, arrived
from wire.messages import PLANT, LinkReport, Nameplate, Pacing, PlantEvent, State, Stop
from wire.printable import printable

CLOSING = 2.0
"""Longest wait for the others to close (s)."""


LINK_TICKS = 100
"""What emulated links to the plant did is sent every so many ticks."""


class Side(Endpoint):
    """The plant on a wire.

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
        self.instances: dict[str, str] = {}
        """The one instance of each agent that takes part."""
        self.plates: dict[str, Nameplate] = {}
        self._links = links
        self._ticks = None if config.end is None else ticks_until(config.end, config.T_c)
        self._recorders: set[str] = set()
        self._tokens: set[str] = set()
        """All tokens of agents and recorders that are there now, refused ones too."""
        self._schedule = Schedule(config, plant.inverters)
        self._reporter = Reporter(config.incarnation, plant)
        self._last_due = False
        """Whether the last telemetry is yet to be sent, though the run has ended."""
        self._introduced: dict[str, str] = {}
        """Of each agent whose epoch is known the instance that told it."""

    @property
    def token(self) -> str:
        """Key of the plant's liveliness token."""
        return self.keys.alive_plant(self.config.incarnation)

    @property
    def watched(self) -> str:
        """Key expression of the tokens to watch."""
        return self.keys.any_alive

    @property
    def t(self) -> float:
        """Run time the plant stands at (s)."""
        return time_of(self.tick, self.config.T_c)

    def stop(self, key: str, reason: str, *, refused: bool = False) -> None:
        """Tell one agent, or all, to close."""
        incarnation = self.config.incarnation
        stop = Stop(
            sender=PLANT, incarnation=incarnation, seq=self.tick, t=self.t, reason=printable(reason), refused=refused
        )
        self._publish(key, encode(stop))

    # ---------------------------------------------------------------- agents

    def _fetch_nameplate(self, name: str, instance: str) -> None:
        """Ask the process that speaks for a name who it is."""
        key = self.keys.nameplate(name, instance)
        self._routes[key] = Route(name, (Nameplate,), partial(self._on_answer, instance), early=True)
        self._actions.append(Fetch(key))

    def _on_answer(self, instance: str, plate: Nameplate, payload: bytes, now: float) -> None:
        name = plate.sender
        if self.instances.get(name) != instance:
            raise RejectedError("ghost", f"instance {instance} of {name} does not take part")
        if not is_news(plate, self.plates.get(name)):
            return
        self._introduced[name] = instance
        self.admission.bind(name, plate.incarnation)
        self._on_nameplate(plate, now)

    def _on_nameplate(self, plate: Nameplate, now: float) -> None:
        """Take in an agent that has said who it is."""
        raise NotImplementedError

    def _note_state(self, state: State) -> None:
        """Note what a state says beside its set-points: a law that has failed, or that does not tell its neighbours."""
        if state.fault:
            text = f"{state.sender}: {state.fault}; its agent stands still, its inverter stays on primary droop"
            self._reporter.note(PlantEvent(t=self.t, kind="law", subject=state.sender, text=printable(text)))
        if state.quiet:
            self._reporter.note_quiet(self.t)

    def _gone(self, name: str, instance: str) -> None:
        """Note that a process is gone: what still comes from it is a ghost's."""
        self._routes.pop(self.keys.nameplate(name, instance), None)
        if self._introduced.get(name) == instance:
            del self._introduced[name]
            self.admission.release(name)

    def _news(self, now: float) -> Iterable[State]:
        """States that the emulated links have let through by now (s of run time) and that are of use."""
        return (state for state in arrived(self._links, now, self.rejects, self.admission) if isinstance(state, State))

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

    def _on_report(self, report: LinkReport, payload: bytes, now: float) -> None:
        """Pass on what an agent's links did; it closes once it knows that its last report is here."""
        self._publish(self.keys.telemetry, payload)
        if report.final:
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
        others: int = 0,
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
            others=others,
        )
        for message in messages:
            self._publish(self.keys.telemetry, encode(message))
