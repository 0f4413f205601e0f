"""Orders to emulated links while a run goes on: numbered, kept for who comes later, sent until answered. Pure."""

from __future__ import annotations

from wire.messages import PLANT, LinkOrder

AGAIN = 1.0
"""Time (s, wall) after which an order that was not answered is sent again."""


class Orders:
    """All orders of a run so far.

    Parameters
    ----------
    incarnation : int
        The plant's life.

    Examples
    --------
    >>> orders = Orders(1)
    >>> _ = orders.give("cut", 2.0, "somebody")
    >>> [len(orders.due("inv1", now)) for now in (0.0, 0.5, 1.0)]
    [1, 0, 1]
    >>> orders.done("inv1", 1)
    >>> orders.due("inv1", 9.0)
    []
    """

    def __init__(self, incarnation: int) -> None:
        self._incarnation = incarnation
        self._given: list[LinkOrder] = []
        self._done: dict[str, int] = {}
        """Number of the last order that each agent has answered."""
        self._sent: dict[str, tuple[int, float]] = {}
        """Number of the last order that was sent to each agent, and when."""

    def give(self, text: str, t: float, reply_to: str) -> LinkOrder:
        """Note an order that holds for messages sent at t (s of run time) or later."""
        order = self._order(len(self._given) + 1, text, t, reply_to)
        self._given.append(order)
        return order

    def question(self, t: float, reply_to: str) -> LinkOrder:
        """How do the links stand? It is not kept."""
        return self._order(0, "", t, reply_to)

    def due(self, name: str, now: float) -> list[LinkOrder]:
        """What is to be sent to an agent now (s on the driver's clock): what is new, or what it has not answered."""
        last, sent, at = len(self._given), *self._sent.get(name, (0, now))
        done = self._done.get(name, 0)
        if done == last or (sent == last and now - at < AGAIN):
            return []
        self._sent[name] = last, now
        return self._given[done if now - at >= AGAIN else max(done, sent) :]

    def done(self, name: str, number: int) -> None:
        """Note that an agent has taken an order, and with it all before."""
        self._done[name] = max(self._done.get(name, 0), min(number, len(self._given)))

    def forget(self, name: str) -> None:
        """Note that an agent is gone: who comes under its name is told all."""
        self._done.pop(name, None)
        self._sent.pop(name, None)

    def _order(self, number: int, text: str, t: float, reply_to: str) -> LinkOrder:
        return LinkOrder(sender=PLANT, incarnation=self._incarnation, seq=number, t=t, text=text, reply_to=reply_to)
