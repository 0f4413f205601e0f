"""Orders to the emulated links into an agent: taken in their sequence, each once, and answered. Pure."""

from __future__ import annotations

from wire.links import Links
from wire.messages import LinkAnswer, LinkOrder
from wire.printable import printable


class Orders:
    """Takes the plant's orders for the links into one agent.

    The plant sends again what is not answered, so an order may come twice, and one behind a lost one waits for it:
    which of two orders came later decides which of them holds.

    Parameters
    ----------
    name : str
        The agent.
    incarnation : int
        Its life.
    links : Links or None
        Its links; without any, orders are answered by a refusal.
    """

    def __init__(self, name: str, incarnation: int, links: Links | None) -> None:
        self._name, self._incarnation, self._links = name, incarnation, links
        self.done = 0
        """Number of the last order that was taken."""

    def restart(self) -> None:
        """Forget all orders: another plant has begun, whose run starts at 0."""
        self.done = 0
        if self._links is not None:
            self._links.restart()

    def take(self, order: LinkOrder, t: float) -> LinkAnswer | None:
        """Have an order done, or tell at t (s of run time) how the links stand; None if an earlier order is missing."""
        if self._links is None:
            return self._answer(order, ok=False, text="there are no emulated links to this agent")
        if order.seq == 0:
            return self._answer(order, ok=True, text="", data=self._links.standing(t))
        if order.seq > self.done + 1:
            return None
        if order.seq <= self.done:
            return self._answer(order, ok=True, text="done before")
        self.done = order.seq
        try:
            return self._answer(order, ok=True, text=self._links.order(order.text, order.t))
        except ValueError as error:
            return self._answer(order, ok=False, text=str(error))

    def _answer(self, order: LinkOrder, *, ok: bool, text: str, data: bytes = b"") -> LinkAnswer:
        return LinkAnswer(
            sender=self._name,
            incarnation=self._incarnation,
            seq=order.seq,
            t=order.t,
            ok=ok,
            text=printable(text),
            reply_to=order.reply_to,
            data=data,
        )
