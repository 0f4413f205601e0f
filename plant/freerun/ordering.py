"""Orders that people give to the emulated links of a running plant: given, sent on, answered. Wall-clock time; pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from plant.freerun.orders import Orders
from wire.codec import encode
from wire.keys import Keys
from wire.links import Links
from wire.messages import PLANT, LinkAnswer, LinkOrder

NO_LINKS = "this run has no emulated links that could be changed; runs started by gridpeers plant or up have"
"""What is answered to an order in vain."""


class Ordering:
    """Has the links to the plant and to all agents do what was ordered.

    Parameters
    ----------
    incarnation : int
        The plant's life.
    keys : Keys
        The run's.
    links : Links or None
        Those to the plant; without any, nobody can be given orders.
    publish : Callable[[str, bytes], None]
        Publishes bytes under a key.
    """

    def __init__(
        self, incarnation: int, keys: Keys, links: Links | None, publish: Callable[[str, bytes], None]
    ) -> None:
        self._incarnation, self._keys, self._links, self._publish = incarnation, keys, links, publish
        self._orders = Orders(incarnation)

    def give(self, text: str, t: float, reply_to: str) -> tuple[LinkOrder, str, tuple[str, ...]]:
        """Have links do what a person ordered, for messages sent at t (s of run time) or later.

        It is in force for the plant's own links, and told to who records; `send` tells the agents.

        Returns
        -------
        tuple[LinkOrder, str, tuple[str, ...]]
            The order, what it does in words, and the receivers of the links that it changes.

        Raises
        ------
        ValueError
            If it is no order, or the run has no emulated links.
        """
        links = self._must_have_links()
        said, receivers = links.told(text, t)
        links.order(text, t)
        order = self._orders.give(text, t, reply_to)
        self._publish(self._keys.telemetry, encode(order))
        return order, said, receivers

    def send(self, names: Iterable[str], now: float) -> None:
        """Send to each of these agents the orders that it has not been sent, or not answered (s, driver's clock)."""
        for name in names:
            for order in self._orders.due(name, now):
                self._publish(self._keys.order(name), encode(order))

    def check(self) -> None:
        """Make sure that there are links to be asked; ValueError if not."""
        self._must_have_links()

    def ask(self, names: Iterable[str], t: float, reply_to: str) -> None:
        """Have these agents tell how the links to them stand at t (s of run time), and tell it of the own."""
        question = encode(self._orders.question(t, reply_to))
        for name in names:
            self._publish(self._keys.order(name), question)
        self._pass_on(
            LinkAnswer(
                sender=PLANT,
                incarnation=self._incarnation,
                seq=0,
                t=t,
                ok=True,
                text="",
                reply_to=reply_to,
                data=self._must_have_links().standing(t),
            )
        )

    def answered(self, name: str, answer: LinkAnswer) -> None:
        """Note what an agent answered, and tell it to who gave the order."""
        self._orders.done(name, answer.seq)
        self._pass_on(answer)

    def forget(self, name: str) -> None:
        """Note that an agent is gone: who comes under its name is told all."""
        self._orders.forget(name)

    def impaired(self, t: float) -> tuple[str, ...]:
        """Agents between whom and the plant a fault holds at t (s of run time)."""
        return () if self._links is None else self._links.impaired(t)

    def _must_have_links(self) -> Links:
        if self._links is None:
            raise ValueError(NO_LINKS)
        return self._links

    def _pass_on(self, answer: LinkAnswer) -> None:
        self._publish(self._keys.answer(answer.reply_to), encode(answer))
