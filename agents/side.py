"""What an agent's side of simulated and of wall-clock time have in common: who it is, its routes, its actions. Pure."""

from __future__ import annotations

from collections.abc import Callable

from agents.agent import Agent
from agents.config import AgentConfig
from wire.actions import Action, Publish, Say
from wire.codec import RejectedError, Rejects, decode, encode
from wire.keys import Keys
from wire.links import Links
from wire.messages import PLANT, AnyMessage, LinkReport

REPORT_TICKS = 100
"""What emulated links did is sent every so many ticks."""

Handler = Callable[[AnyMessage, bytes, float], None]
"""Takes a message, its bytes, and the time."""


class Side:
    """One agent on a wire.

    Parameters
    ----------
    config : AgentConfig
        Who it is and the run's rule.
    instance : str
        Which process this is, unique in the run; part of the agent's token.
    links : Links or None
        What the links to it do to its messages.
    """

    def __init__(self, config: AgentConfig, instance: str, links: Links | None) -> None:
        self.keys = Keys(config.run)
        self.rejects = Rejects(config.name)
        self.stopped = ""
        """Why it closes; empty as long as it goes on."""
        self.failed = ""
        """Why this agent could not go on, or take part at all; empty unless so."""
        self.plant_seen = False
        """Whether the plant's token was ever there."""
        self._config, self._name, self._instance = config, config.name, instance
        self._agent = Agent(config)
        try:
            decode(encode(self._agent.nameplate))
        except RejectedError as rejected:
            raise ValueError(f"{config.name}: this nameplate would be refused by everybody: {rejected.text}") from None
        self._links = links
        self._actions: list[Action | Say] = []
        self._routes: dict[str, tuple[str, Handler]] = {
            self.keys.control: (PLANT, self._on_control),
            self.keys.dismissal(config.name, instance): (PLANT, self._on_dismissal),
            self.keys.measurement(config.name): (PLANT, self._on_measurement),
        }
        self._plant_incarnation = 0

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

    def take_actions(self) -> list[Action | Say]:
        """What is to be done now, in this order."""
        actions, self._actions = self._actions, []
        return actions

    def work(self, now: float) -> bool:
        """Nothing: an agent computes when a message makes it possible, or its tick is due."""
        return False

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; what cannot be used is counted and dropped. What comes after the end is for nobody."""
        if self.over:
            return
        try:
            if key not in self._routes:
                raise RejectedError("foreign", "nothing was asked for on this key")
            sender, handler = self._routes[key]
            message = decode(payload)
            if message.sender != sender:
                self._misled(sender, message.sender)
                raise RejectedError("foreign", f"sender {message.sender}, {sender} was expected")
            handler(message, payload, now)
            self._used(message, now)
        except RejectedError as rejected:
            self.rejects.add(rejected.kind, key, rejected.text)

    def _misled(self, expected: str, sender: str) -> None:
        """Note a message that came under another's key."""

    def _used(self, message: AnyMessage, now: float) -> None:
        """Note a message that was of use."""

    def _on_control(self, message: AnyMessage, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _on_dismissal(self, message: AnyMessage, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _on_measurement(self, message: AnyMessage, payload: bytes, now: float) -> None:
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

    def _publish(self, key: str, payload: bytes) -> None:
        self._actions.append(Publish(key, payload))
