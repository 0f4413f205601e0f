"""Scheduled switches and available power of a GridLAB-D run, by step: as writes and as events. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from gridpeers.plant.dynamics.switch_state import SwitchState
from gridpeers.plant.equipment.inverter_parameters import GflParameters, InverterParameters
from gridpeers.plant.feeder.circuits import Circuits
from gridpeers.plant.feeder.islands import Islands
from gridpeers.plant.feeder.switchboard import Switchboard
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, PowerLimit
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.timing import time_of

Write = tuple[str, str, Any]
"""A value for GridLAB-D: object, property, value."""


class GridlabdSchedule:
    """Switches and available power of a run; all inverters are on the network.

    Parameters
    ----------
    network
        The feeder's network; it names switches and islands.
    settings
        Events, limits and the step.
    parameters
        Parameters of each inverter.
    """

    def __init__(self, network: Network, settings: PlantSettings, parameters: Mapping[str, InverterParameters]) -> None:
        self._network, self._h, self._parameters = network, settings.h, parameters
        self._units = {unit.name: unit for unit in network.inverters}
        self._switches = Switchboard(network, settings.events, settings.h)
        self._circuits, self._islands = Circuits(network), Islands(network)
        self._state = self._switch_state()
        self._limits: dict[int, list[PowerLimit]] = {}
        for limit in settings.limits:
            self._limits.setdefault(round(limit.t / settings.h), []).append(limit)

    def start(self) -> list[PlantEvent]:
        """Return the events of t = 0."""
        return self._islands.report_dead(0.0, self._switches.closed, self._state)

    def islands(self) -> tuple[list[str], list[bool]]:
        """Return the island of each inverter, and whether the substation feeds it."""
        return self._islands.names(self._state)

    def after(self, step: int) -> Iterable[int]:
        """Return the later steps at which something happens."""
        return (at for at in (*self._switches.steps, *self._limits) if at > step)

    @property
    def positions(self) -> dict[str, bool]:
        """Position of each switch now, by its name: whether it is closed."""
        return self._switches.positions

    def put(self, step: int, name: str, action: str) -> bool:
        """Operate a switch ("open" or "close") at a step; return whether it is in that state already."""
        known = self._network.switch_name(name)
        self._switches.put(step, known, action)
        return (known in self._switches.closed) == (action == "close")

    def happen(self, step: int) -> tuple[list[Write], list[PlantEvent]]:
        """Return what GridLAB-D is given at a step, and its events.

        GridLAB-D loses an island if two switches that part it open in one step: the others wait for the next steps.
        """
        t = time_of(step, self._h)
        writes: list[Write] = []
        events: list[PlantEvent] = []
        due = self._switches.due(step)
        for operation in due[1:]:
            self._switches.drop(step, operation)
            self._switches.put(step + 1, operation.switch, operation.action)
            switch = self._switches.switch(operation.switch)
            text = f"GridLAB-D operates one switch a step: {switch.full_name} follows {self._h * 1e3:g} ms later"
            events.append(PlantEvent(t=t, kind="warning", subject=switch.event_name, text=text))
        if due:
            writes.append((f"s{due[0].switch}", "status", due[0].action))
            events += self._switches.operate(step)
            self._state = self._switch_state()
            events += self._islands.report(t, self._switches.closed, self._state)
        for limit in self._limits.pop(step, ()):
            unit, own = self._units[limit.inverter], self._parameters[limit.inverter]
            assert isinstance(own, GflParameters), "a scenario limits the power of a GFL alone"
            writes.append((limit.inverter, "Pref_max", limit.P_max / (unit.P_rated * own.S_max)))
            text = f"{limit.inverter} has {limit.P_max / 1e3:g} kW available"
            events.append(PlantEvent(t=round(limit.t, 9), kind="limit", subject=limit.inverter, text=text))
        return writes, events

    def _switch_state(self) -> SwitchState:
        circuit = self._circuits.of(self._switches.closed)
        forming = np.array([unit.kind == "GFM" for unit in self._units.values()])
        return SwitchState(circuit, np.zeros(forming.size, complex), forming, np.ones(forming.size, bool))
