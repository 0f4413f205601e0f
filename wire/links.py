"""What may stand between the wire and a core: emulated links, of which the cores know only this. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from typing import Protocol

from wire.admission import Admission
from wire.codec import RejectedError, RejectedMessages, decode
from wire.messages import AnyMessage, Measurement, State


class Arrival(Protocol):
    """A message that a link has let through."""

    @property
    def src(self) -> str:
        """Who sent it."""
        ...

    @property
    def payload(self) -> bytes:
        """Its bytes, as the link left them."""
        ...


class Links(Protocol):
    """All links into one receiver. Times are run time (s), on whichever clock the receiver uses throughout.

    `netem` has the real one; without any (None) a core takes messages as they come.
    """

    @property
    def clear(self) -> Set[str]:
        """Senders whose messages `offer` is known not to take: asked of every message, so no call."""
        ...

    @property
    def dropped(self) -> int:
        """Messages that the links have lost, of all senders."""
        ...

    def offer(self, src: str, seq: int, t: float, at: float, payload: bytes) -> bool:
        """Take a message off the wire, unless nothing ever happens to messages from there; whether it was taken.

        Parameters
        ----------
        src : str
            Who sent it.
        seq : int
            Its number, by which its fate is drawn.
        t : float
            When it was sent, for what the links do at certain times.
        at : float
            When it would be here if the link did nothing: now.
        payload : bytes
            The message.
        """
        ...

    def due(self, now: float) -> Sequence[Arrival]:
        """Take out what has arrived by now, in the order of arrival."""
        ...

    def stalled(self, t: float) -> bool:
        """Whether the receiver itself is to stand still at t (s of run time)."""
        ...

    def order(self, text: str, t: float) -> str:
        """Change what the links do from t on, as a person said; which links changed, "" if none of those here.

        Raises
        ------
        ValueError
            If it is no order to links.
        """
        ...

    def told(self, text: str, t: float) -> tuple[str, tuple[str, ...]]:
        """Say an order that is to hold from t on for people, in one line; and whose links it changes: their receivers.

        Raises
        ------
        ValueError
            If it is no order to links, or none that can be meant.
        """
        ...

    def impaired(self, t: float) -> tuple[str, ...]:
        """From whom links have a fault at t (s of run time)."""
        ...

    def standing(self, t: float) -> bytes:
        """How the links stand at t (s of run time), for who asked."""
        ...

    def restart(self) -> None:
        """Begin anew, without what was ordered and what is on its way: the run's time starts from 0 again."""
        ...

    def report(self, *, last: bool = False) -> tuple[bytes, ...]:
        """Take out what the links did since last asked, for the record; the last time, something in any case."""
        ...


def is_usable(links: Links | None, message: State | Measurement, payload: bytes, at: float, who: Admission) -> bool:
    """Whether a message off the wire is of use at once; if not, it may come out of `arrived` later, or never.

    An emulated link takes the message if it came over one. The state of an agent that stands still only keeps the
    lock-step going: no link carries it, and nobody uses it.

    Parameters
    ----------
    links : Links or None
        All links into the receiver.
    message, payload : State or Measurement, bytes
        What came off the wire.
    at : float
        Now (s of run time, on the receiver's clock).
    who : Admission
        Who speaks.
    """
    if isinstance(message, State) and message.idle:
        return False
    if links is not None and message.sender not in links.clear:
        taken = links.offer(message.sender, message.seq, message.t, at, payload)
        return not taken and who.passes(message)
    return who.passes(message)


def arrived(links: Links | None, now: float, rejects: RejectedMessages, admission: Admission) -> Iterator[AnyMessage]:
    """What the links have let through by now (s of run time) and is of use.

    What they have garbled is counted and dropped; what was overtaken on the way, and what the dead once said, is only
    dropped: links that delay do that to sound messages.
    """
    if links is None:
        return
    for arrival in links.due(now):
        try:
            message = decode(arrival.payload)
            if message.sender != arrival.src:
                raise RejectedError("foreign", f"sender {message.sender}")
        except RejectedError as rejected:
            rejects.add(rejected.kind, f"the link from {arrival.src}", rejected.text)
            continue
        if admission.passes(message):
            yield message
