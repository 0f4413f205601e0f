"""False states at one receiver: from an agent that lies, or from another that lies in its name. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from math import inf
from typing import NamedTuple

from gridpeers.netem.draws import Stream
from gridpeers.netem.models import INSTANT
from gridpeers.netem.models.lie import Before, Lie, lie_in_words
from gridpeers.netem.schema.netem import Netem
from gridpeers.wire.messages import PLANT, State


class LieTime(NamedTuple):
    since: float
    until: float
    liar: str
    lie: Lie

    def holds(self, t: float) -> bool:
        return self.since - INSTANT <= t < self.until - INSTANT


def lies_about(netem: Netem, sender: str, receiver: str) -> tuple[LieTime, ...]:
    """Return the lies that a receiver hears under a sender's name, in the order in which they apply.

    The sender's own come first. A liar does not believe what it says in another's name.
    """
    found = []
    for node in netem.nodes:
        lie = node.lies
        if lie is None or (lie.in_name_of or node.name) != sender or node.name == receiver:
            continue
        if receiver != PLANT or lie.plant:
            found.append(LieTime(node.from_s, inf if node.to_s is None else node.to_s, node.name, lie))
    return tuple(sorted(found, key=lambda each: each.liar != sender))


class HeardFrom:
    """The states of one sender as one receiver hears them, by the lies about the sender (`lies_about`).

    Examples
    --------
    >>> from gridpeers.netem.models.lie import Offset
    >>> heard = HeardFrom(1, "inv3", "inv1", [LieTime(1.0, 2.0, "inv3", Offset(P_set_W=5.0))])
    >>> states = [State(sender="inv3", epoch=1, seq=k, t=0.5 * k, P_set=1.0, V_set=1.0, Q=0.0) for k in range(5)]
    >>> [heard.told(state, lambda t: states[0]).P_set for state in states]
    [1.0, 1.0, 6.0, 6.0, 1.0]
    """

    def __init__(self, seed: int, sender: str, receiver: str, lies: Iterable[LieTime]) -> None:
        self._seed, self._sender, self._receiver = seed, sender, receiver
        self.lies = tuple(lies)
        self._streams: dict[tuple[str, bool, str], Stream] = {}

    def told(self, state: State, before: Before) -> State:
        """Return what is heard in place of a true state; `before` gives the last true one at a run time (s)."""
        for each in self.lies:
            if each.holds(state.t):
                state = each.lie.told(state, each.since, before, self._draw(each))
        return state

    def in_words(self, t: float) -> str:
        """Return the lies at t (s of run time) in words, "" if there are none."""
        told = (each for each in self.lies if each.holds(t))
        return "; ".join(
            f"{'' if each.liar == self._sender else each.liar + ' '}lies: {lie_in_words(each.lie)}" for each in told
        )

    def _draw(self, each: LieTime) -> Callable[[str], Stream]:
        two_faced = bool(getattr(each.lie, "two_faced", False))

        def stream(quantity: str) -> Stream:
            key = each.liar, two_faced, quantity
            if key not in self._streams:
                to = self._receiver if two_faced else ""
                self._streams[key] = Stream(self._seed, f"{each.liar} {self._sender}", to, f"lie {quantity}")
            return self._streams[key]

        return stream

    def oldest_needed(self, t: float) -> float:
        """Return the run time (s) from which on true states may still be needed at t (s) or later."""
        needed = t
        for each in self.lies:
            reach = each.lie.reach
            if t < each.until and reach != 0.0:
                needed = min(needed, each.since if reach is None else t - reach)
        return needed


class LiveHearing:
    """The same with a memory of its own of the sender's true states, as long as a lie may need them."""

    def __init__(self, heard: HeardFrom) -> None:
        self._heard = heard
        self._states: deque[State] = deque()
        self._remembers = any(each.lie.reach != 0.0 for each in heard.lies)

    def told(self, state: State) -> State:
        """Return what is heard in place of a true state that has come."""
        if not self._remembers:
            return self._heard.told(state, lambda t: state)
        states = self._states
        if states and states[-1].epoch != state.epoch:
            states.clear()
        states.append(state)
        needed = self._heard.oldest_needed(state.t) - 2.0 * INSTANT
        while len(states) > 1 and states[1].t <= needed + INSTANT:
            states.popleft()
        return self._heard.told(state, lambda t: last_before(states, t))


def last_before(states: Iterable[State], t: float) -> State:
    """Return the last of some states, oldest first, at a run time (s) or before it; the first if none is so old."""
    found = None
    for state in states:
        if found is not None and state.t > t + INSTANT:
            break
        found = state
    assert found is not None
    return found
