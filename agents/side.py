"""Base of an agent's endpoint in both kinds of time: its routes and its reports. Pure."""

from __future__ import annotations

from math import inf

from agents.agent import Agent, check_nameplate
from agents.config import AgentConfig
from agents.laws.law import Law
from wire.codec import RejectedError, encode
from wire.endpoint import Route
from wire.links import Links
from wire.messages import PLANT, LinkReport, Measurement, Stop
from wire.plant_follower import PlantFollower

REPORT_TICKS = 100
"""What emulated links did is sent every so many ticks."""


class Side(PlantFollower):
    """One agent on a wire.

    Parameters
    ----------
    config : AgentConfig
        Who it is and the run's rule.
    instance : str
        Which process this is, unique in the run; part of the agent's token.
    links : Links or None
        What the links to it do to its messages.
    law : Law or None
        What decides its set-points; None is the paper's.
    rate : float, optional
        Most messages of one sender per s of run time; see `wire.admission`.
    """

    def __init__(
        self, config: AgentConfig, instance: str, links: Links | None, law: Law | None, rate: float = inf
    ) -> None:
        super().__init__(config.name, config.run, rate)
        check_nameplate(config)
        self.stopped = ""
        """Why it closes; empty as long as it goes on."""
        self.failed = ""
        """Why this agent could not go on, or take part at all; empty unless so."""
        self.plant_seen = False
        """Whether the plant's token was ever there."""
        self._config, self._name, self._instance = config, config.name, instance
        self._agent = Agent(config, law)
        self._links = links
        self._routes[self.keys.dismissal(config.name, instance)] = Route(PLANT, (Stop,), self._on_dismissal)
        self._routes[self.keys.measurement(config.name)] = Route(PLANT, (Measurement,), self._on_own_measurement)

    @property
    def token(self) -> str:
        """Key of the own liveliness token."""
        return self.keys.alive_agent(self._name, self._instance)

    @property
    def nameplate(self) -> tuple[str, bytes]:
        """Key of the own queryable, and its answer."""
        return self.keys.nameplate(self._name, self._instance), encode(self._agent.nameplate)

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Keys to subscribe to before the token is declared."""
        return tuple(self._routes)

    @property
    def watched(self) -> str:
        """Key expression of the tokens to watch."""
        return self.keys.any_alive

    @property
    def over(self) -> bool:
        """Whether the driver should close."""
        return bool(self.stopped or self.failed)

    def work(self, now: float) -> bool:
        """Nothing: an agent computes when a message makes it possible, or its tick is due."""
        return False

    # ---------------------------------------------------------------- the plant

    def _plant_appeared(self, part: str) -> bool:
        known = super()._plant_appeared(part)
        self.plant_seen |= known
        return known

    def _on_own_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        if message.to != self._name:
            raise RejectedError("unexpected", f"the measurement of {message.to}")
        self._on_measurement(message, payload, now)

    def _on_dismissal(self, message: Stop, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _report_links(self, *, final: bool = False) -> None:
        """Send what the emulated links did of late."""
        parts = () if self._links is None else self._links.report(last=final)
        for data in parts:
            report = LinkReport(
                sender=self._name,
                incarnation=self._config.incarnation,
                seq=0,
                t=0.0,
                data=data,
                instance=self._instance,
                final=final and data is parts[-1],
            )
            self._publish(self.keys.report(self._name), encode(report))
