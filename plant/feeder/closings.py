"""Switches that join live islands: those that may close now, those that wait for synchronism, and their events."""

from __future__ import annotations

from typing import NamedTuple

from gridpeers.plant.feeder.switchboard import Switchboard
from gridpeers.plant.feeder.synchronism import Difference, Synchronism
from gridpeers.plant.feeder.trips import Closing
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.timing import time_of


class _Pending(NamedTuple):
    """A closing that waits for synchronism."""

    since: int
    """Step of its scheduled closing."""
    last: int
    """Step at which it gives up."""


class Closings:
    """Judge the closings of a feeder's switches.

    Parameters
    ----------
    switches
        The switches.
    sync
        Measures the differences across them.
    timeout
        Longest wait of a switch for synchronism (steps).
    h
        Step (s).

    Attributes
    ----------
    joined : list of Closing
        Closings that have joined live islands, the latest last.
    """

    def __init__(self, switches: Switchboard, sync: Synchronism, timeout: int, h: float) -> None:
        self._switches, self._sync, self._timeout, self._h = switches, sync, timeout, h
        self._waiting: dict[str, _Pending] = {}
        self.joined: list[Closing] = []

    def difference(self, name: str) -> Difference | None:
        """Return the difference across a switch (by its name) now; None if it does not part two live islands."""
        return self._sync.across(name, self._switches.closed)

    def refusal(self, name: str) -> str:
        """Return why a switch (by its name) may not close now under a synchronism check; "" if it may."""
        difference = self.difference(name)
        if difference is None or difference.within:
            return ""
        return (
            f"switch {self._switches.switch(name).full_name} not closed: its sides are {difference}; allowed are "
            f"{difference.limits}; {difference.way_out}, or close it without the check"
        )

    def check_waiting(self, step: int) -> list[PlantEvent]:
        """Close the waiting switches that are in step now; return the events of those that give up."""
        events = []
        for name, waiting in list(self._waiting.items()):
            difference = self._sync.across(name, self._switches.closed)
            if difference is None or difference.within:
                del self._waiting[name]
                self._switches.put(step, name, "close", synchronised=True)
            elif step >= waiting.last:
                del self._waiting[name]
                waited = (step - waiting.since) * self._h
                text = f"not closed: not in step within {waited:g} s, now {difference}; allowed are {difference.limits}"
                events.append(self._warning(step, name, text))
        return events

    def judge(self, step: int) -> tuple[dict[str, str], list[PlantEvent]]:
        """Hold back closings that must wait, among the operations of a step; return notes by switch, and events."""
        closed = self._switches.closed
        due = self._switches.due(step)
        closing = [operation.switch for operation in due if operation.action == "close"]
        notes: dict[str, str] = {}
        events: list[PlantEvent] = []
        for operation in due:
            name = operation.switch
            self._waiting.pop(name, None)  # a new operation replaces a waiting one
            if operation.action != "close" or name in closed:
                continue
            difference = self._sync.across(name, closed, closing)
            if difference is None:
                continue
            if operation.synchronised and not difference.within:
                self._switches.drop(step, operation)
                self._waiting[name] = _Pending(step, step + self._timeout)
                text = f"waits for synchronism: its sides are {difference}; allowed are {difference.limits}"
                events.append(self._warning(step, name, text))
            elif operation.synchronised:
                notes[name] = f" in step: {difference}"
                self._note(step, difference)
            else:
                events.append(self._warning(step, name, f"joins two live islands: its sides are {difference}"))
                self._note(step, difference)
        return notes, events

    def _note(self, step: int, difference: Difference) -> None:
        t = time_of(step, self._h)
        self.joined.append(Closing(t, difference.switch, difference.angle, difference.angle <= difference.limits.angle))
        del self.joined[:-20]

    def _warning(self, step: int, name: str, text: str) -> PlantEvent:
        switch = self._switches.switch(name)
        text = f"switch {switch.full_name} {text}"
        return PlantEvent(t=time_of(step, self._h), kind="warning", subject=switch.event_name, text=text)
