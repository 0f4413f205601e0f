"""Commands that people give to emulated links while a run goes on: numbered, kept, sent until acknowledged. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from gridpeers.wire.codec import encode
from gridpeers.wire.keys import Keys
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, LinkAcknowledgement, LinkRequest

NO_LINKS = "this run has no emulated links that could be changed; runs started by gridpeers plant or up have"
"""Error when a run has no emulated links."""

AGAIN = 1.0
"""Time (s, wall) after which a command that was not acknowledged is sent again."""


class LinkCommandSender:
    """Has the links to the plant and to all agents carry out commands.

    Parameters
    ----------
    epoch : int
        The plant's epoch.
    keys : Keys
        The run's.
    links : Links or None
        The links to the plant; without any, commands are rejected.
    publish : Callable[[str, bytes], None]
        Publishes bytes under a key.
    """

    def __init__(self, epoch: int, keys: Keys, links: Links | None, publish: Callable[[str, bytes], None]) -> None:
        self._epoch, self._keys, self._links, self._publish = epoch, keys, links, publish
        self._given: list[LinkRequest] = []
        self._acknowledged: dict[str, int] = {}
        """Number of the last command that each agent has acknowledged."""
        self._sent: dict[str, tuple[int, float]] = {}
        """Number of the last command that was sent to each agent, and when (s)."""

    @property
    def links(self) -> Links:
        """The links to the plant.

        Raises
        ------
        ValueError
            If the run has no emulated links.
        """
        if self._links is None:
            raise ValueError(NO_LINKS)
        return self._links

    def give(self, tree: dict[str, Any], t: float, reply_to: str) -> tuple[LinkRequest, str, tuple[str, ...]]:
        """Have links carry out a person's command, for messages sent at t (s of run time) or later.

        It is in force for the plant's own links, and published for recorders; `send` sends it to the agents.

        Returns
        -------
        tuple[LinkRequest, str, tuple[str, ...]]
            The command, what it does in words, and the receivers of the links that it changes.

        Raises
        ------
        ValueError
            If it is no command to links, or the run has no emulated links.
        """
        text, receivers, _ = self.links.command(tree, t)
        request = self._request(len(self._given) + 1, tree, t, reply_to)
        self._given.append(request)
        self._publish(self._keys.telemetry, encode(request))
        return request, text, receivers

    def send(self, names: Iterable[str], now: float) -> None:
        """Send to each agent the commands that are new, or that it has not acknowledged (s, driver's clock)."""
        last = len(self._given)
        for name in names:
            sent, at = self._sent.get(name, (0, now))
            acknowledged, again = self._acknowledged.get(name, 0), now - at >= AGAIN
            if acknowledged == last or (sent == last and not again):
                continue
            self._sent[name] = last, now
            for request in self._given[acknowledged if again else max(acknowledged, sent) :]:
                self._publish(self._keys.link_request(name), encode(request))

    def ask(self, names: Iterable[str], t: float, reply_to: str) -> None:
        """Have these agents report the status of the links to them at t (s of run time), and report the plant's own."""
        question = encode(self._request(0, {}, t, reply_to))
        for name in names:
            self._publish(self._keys.link_request(name), question)
        own = self.links.status(t)
        epoch = self._epoch
        self._pass_on(
            LinkAcknowledgement(sender=PLANT, epoch=epoch, seq=0, t=t, ok=True, text="", reply_to=reply_to, data=own)
        )

    def answered(self, answer: LinkAcknowledgement) -> None:
        """Note the answer of an agent, and pass it on to the client that gave the command."""
        name = answer.sender
        self._acknowledged[name] = max(self._acknowledged.get(name, 0), min(answer.seq, len(self._given)))
        self._pass_on(answer)

    def forget(self, name: str) -> None:
        """Note that an agent is gone: the next agent of its name is sent all commands."""
        self._acknowledged.pop(name, None)
        self._sent.pop(name, None)

    def impaired(self, t: float) -> tuple[str, ...]:
        """Return the agents whose link to or from the plant has a fault at t (s of run time)."""
        return () if self._links is None else self._links.impaired(t)

    def _request(self, number: int, tree: dict[str, Any], t: float, reply_to: str) -> LinkRequest:
        return LinkRequest(sender=PLANT, epoch=self._epoch, seq=number, t=t, link_command=tree, reply_to=reply_to)

    def _pass_on(self, answer: LinkAcknowledgement) -> None:
        self._publish(self._keys.answer(answer.reply_to), encode(answer))
