"""What a receiver heard of an agent that lied: the record has true states as they were sent, and the run's faults."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from gridpeers.netem.liar import HeardFrom, lies_about
from gridpeers.netem.models import INSTANT
from gridpeers.netem.models.lie import Before
from gridpeers.scenarios.emulation.emulation_config import EmulationConfig
from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.wire.messages import State

_REACH = 2.0
"""How far (s) a state may be from where its number says: in wall-clock time agents tick by their own clocks."""


def hearing_of(links: Mapping[str, Any], sender: str, receiver: str) -> HeardFrom | None:
    """Return how a receiver hears a sender by the tree `links` of its configuration; None if nobody lies about it."""
    if not links:
        return None
    netem = EmulationConfig.of_tree(links).netem
    lies = lies_about(netem, sender, receiver)
    return HeardFrom(netem.seed, sender, receiver, lies) if lies else None


class StatesInRecord:
    """Earlier states of senders, as they were sent.

    Parameters
    ----------
    index : MessageIndex
        Messages of the record.
    """

    def __init__(self, index: MessageIndex) -> None:
        self._index = index
        self._state = lru_cache(maxsize=20_000)(self._read)
        self._last = lru_cache(maxsize=1000)(self._last_before)

    def before(self, state: State) -> Before:
        """Return the way from a run time (s) to the last state of the same process then, or its first one."""
        return lambda t: self._last(state.sender, state.epoch, state.seq, state.t, t) or state

    def _read(self, sender: str, epoch: int, number: int, t: float) -> State | None:
        if number < 0:
            return None
        found = self._index.state(sender, number, t, epoch, _REACH)
        return found if found is not None and found.epoch == epoch else None

    def _last_before(self, sender: str, epoch: int, number: int, at: float, t: float) -> State | None:
        T_c = self._index.info.T_c

        def state(n: int) -> State | None:
            return self._state(sender, epoch, n, max(0.0, at - (number - n) * T_c))

        n = max(0, min(number, number - round((at - t) / T_c)))
        while n < number and (later := state(n + 1)) is not None and later.t <= t + INSTANT:
            n += 1
        first = None
        while (found := state(n)) is not None:
            if not (found.idle or found.quiet):  # these no receiver hears
                first = found
                if found.t <= t + INSTANT:
                    return found
            n -= 1
        while first is None and n < number:
            n += 1
            found = state(n)
            if found is not None and not (found.idle or found.quiet):
                first = found
        return first
