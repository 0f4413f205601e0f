"""The closed switches of a feeder, and the operations by step."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from gridpeers.plant.equipment import Switch
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import SwitchEvent
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.timing import time_of

_PAST = {"open": "opened", "close": "closed"}


class Operation(NamedTuple):
    """An operation of a switch."""

    switch: str
    """Its name."""
    action: str
    """"open" or "close"."""
    synchronised: bool = False
    """Whether to close only in step."""


class Switchboard:
    """The switches of a feeder.

    Parameters
    ----------
    network
        The feeder's network.
    events
        Operations on schedule.
    h
        Step (s).

    Attributes
    ----------
    closed : frozenset of str
        Names of the switches that are closed now.

    Raises
    ------
    ValueError
        If an event names no switch; the message lists all switches.
    """

    def __init__(self, network: Network, events: Iterable[SwitchEvent], h: float) -> None:
        self._network, self._h = network, h
        self.closed = network.closed0
        self._at: dict[int, list[Operation]] = {}
        for event in events:
            self.put(round(event.t / h), event.switch, event.action, synchronised=event.synchronised)

    @property
    def positions(self) -> dict[str, bool]:
        """Position of each switch now, by its name: whether it is closed."""
        return {name: name in self.closed for name in self._network.switches}

    @property
    def steps(self) -> Collection[int]:
        """Steps with operations to come."""
        return self._at.keys()

    def put(self, step: int, name: str, action: str, *, synchronised: bool = False) -> None:
        """Schedule an operation ("open" or "close") of a switch, by its name or alias, at a step.

        Raises
        ------
        ValueError
            If there is no such switch; the message lists all switches.
        """
        known = self._network.switch_name(name)  # first, so that an error leaves the schedule as it is
        self._at.setdefault(step, []).append(Operation(known, action, synchronised))

    def due(self, step: int) -> tuple[Operation, ...]:
        """Return the operations of a step."""
        return tuple(self._at.get(step, ()))

    def drop(self, step: int, operation: Operation) -> None:
        """Remove an operation of a step; the others stay."""
        self._at[step].remove(operation)
        if not self._at[step]:
            del self._at[step]

    def switch(self, name: str) -> Switch:
        """Return a switch by its name in the tables."""
        return self._network.switches[name]

    def foreseen(self) -> Iterator[frozenset[str]]:
        """Yield the closed switches after each step with operations to come, in order of time."""
        closed = self.closed
        for step in sorted(self._at):
            for operation in self._at[step]:
                closed = _operated(closed, operation.switch, operation.action)
            yield closed

    def operate(self, step: int, notes: Mapping[str, str] = MappingProxyType({})) -> list[PlantEvent]:
        """Operate the switches of a step, all at once; return an event of each, with its note."""
        t = time_of(step, self._h)
        events = []
        for name, action, _ in self._at.pop(step):
            known = name in self.closed
            self.closed = _operated(self.closed, name, action)
            already = known == (action == "close")
            what = f"was {'closed' if known else 'open'} already" if already else _PAST[action]
            switch = self.switch(name)
            text = f"switch {switch.full_name} {what}{notes.get(name, '')}"
            closed = action == "close"
            events.append(PlantEvent(t=t, kind="switch", subject=switch.event_name, text=text, closed=closed))
        return events


def _operated(closed: frozenset[str], name: str, action: str) -> frozenset[str]:
    return closed | {name} if action == "close" else closed - {name}
