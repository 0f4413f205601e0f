"""The switches and the loads of a feeder, as a scenario, and people while a run goes on, set them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from gridpeers.plant.equipment import Switch
from gridpeers.plant.equipment.named_loads import LoadPowers, with_powers
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import LoadEvent, SwitchEvent
from gridpeers.wire.messages import LoadSetting, PlantEvent
from gridpeers.wire.timing import time_of

_PAST = {"open": "opened", "close": "closed"}


class Operation(NamedTuple):
    switch: str
    action: str  # "open" or "close"
    synchronised: bool = False  # whether to close only in step


class Switchboard:
    """The switches of a feeder; ValueError, which lists them, if an event names none."""

    def __init__(self, network: Network, events: Iterable[SwitchEvent], h: float) -> None:
        self._network, self._h = network, h
        self.closed = network.closed0
        self._at: dict[int, list[Operation]] = {}
        for event in events:
            self.put(round(event.t / h), event.switch, event.action, synchronised=event.synchronised)

    @property
    def positions(self) -> dict[str, bool]:
        return {name: name in self.closed for name in self._network.switches}

    @property
    def steps(self) -> Collection[int]:
        return self._at.keys()

    def put(self, step: int, name: str, action: str, *, synchronised: bool = False) -> None:
        """Schedule an operation ("open" or "close") of a switch, by its name or alias, at a step."""
        known = self._network.switch_name(name)  # first, so that an error leaves the schedule as it is
        self._at.setdefault(step, []).append(Operation(known, action, synchronised))

    def due(self, step: int) -> tuple[Operation, ...]:
        return tuple(self._at.get(step, ()))

    def drop(self, step: int, operation: Operation) -> None:
        self._at[step].remove(operation)
        if not self._at[step]:
            del self._at[step]

    def switch(self, name: str) -> Switch:
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


class LoadBoard:
    """The powers of a feeder's loads at nominal voltage; ValueError if an event names no load, or makes no sense."""

    def __init__(self, network: Network, events: Iterable[LoadEvent] = (), h: float = 1.0) -> None:
        self._network, self._h = network, h
        self._powers = LoadPowers(network.feeder, sum(unit.P_rated for unit in network.inverters))
        self._set: dict[str, complex] = {}
        self._coming: dict[str, complex] = {}
        self._at: dict[int, list[tuple[str, LoadSetting]]] = {}
        for event in events:
            known = self._powers.name(event.load)
            self._at.setdefault(round(event.t / h), []).append((known, event.setting))
        self._networks = {_key({}): network}
        """Networks of the states of loads that are foreseen: made once, so that their circuits are, too."""
        for _ in self.foreseen():  # makes them, and refuses what makes no sense
            pass

    @property
    def changed(self) -> dict[str, complex]:
        """Power (VA, nominal) of each load that has another one than in the feeder's tables now."""
        return dict(self._set)

    @property
    def steps(self) -> Collection[int]:
        return self._at.keys()

    def foreseen(self) -> Iterator[tuple[int, Network]]:
        """Yield each step with scheduled changes to come and the network from then on, in the order of time."""
        now = dict(self._set)
        for step in sorted(self._at):
            for name, setting in self._at[step]:
                self._put(now, name, self._power(name, setting, now))
            network = self._networks[_key(now)] = self._network_with(now)
            yield step, network

    def put(self, text: str, setting: LoadSetting) -> str:
        """Have a load take another power from the next step on; return it in words, or raise ValueError."""
        name = self._powers.name(text)
        S = self._coming[name] = self._power(name, setting, self._set | self._coming)
        return f"load {name}: {self._powers.words(name, S)}"

    def is_due(self, step: int) -> bool:
        return bool(self._coming) or step in self._at

    def apply(self, step: int) -> tuple[Network, list[PlantEvent]]:
        """Change the loads that are due at a step; return the network with them, and an event of each.

        What the schedule says of a load replaces what a person has set since the last step.
        """
        for name, setting in self._at.pop(step, ()):
            self._coming[name] = self._power(name, setting, self._set | self._coming)
        t, events = time_of(step, self._h), []
        for name, S in self._coming.items():
            text = f"load {name} set to {self._powers.words(name, S)}"
            events.append(PlantEvent(t=t, kind="load", subject=name, text=text, P=S.real, Q=S.imag))
            self._put(self._set, name, S)
        self._coming = {}
        return self._network_with(self._set), events

    def _power(self, name: str, setting: LoadSetting, now: dict[str, complex]) -> complex:
        try:
            return self._powers.power(name, setting, now)
        except ValueError as error:
            raise ValueError(f"load {name}: {error}") from None

    def _put(self, powers: dict[str, complex], name: str, S: complex) -> None:
        if self._powers.table(name) == S:
            powers.pop(name, None)
        else:
            powers[name] = S

    def _network_with(self, powers: dict[str, complex]) -> Network:
        made = self._networks.get(_key(powers))
        return self._network.with_loads(with_powers(self._network.feeder, powers)) if made is None else made


def _key(powers: dict[str, complex]) -> frozenset[tuple[str, complex]]:
    return frozenset(powers.items())
