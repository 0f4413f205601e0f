"""The plant: readings and set-points of the inverters, switches, and the advance of one control period."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from math import isfinite
from typing import Literal

import numpy as np

from gridpeers.plant.dynamics import Circuit, Dynamics, Inverter, PlantError
from gridpeers.plant.dynamics.circuit import NoPowerFlowError
from gridpeers.plant.dynamics.equilibrium import require_within_limits
from gridpeers.plant.dynamics.live_network import KEPT
from gridpeers.plant.feeder.circuits import Circuits
from gridpeers.plant.feeder.islands import Islands, NeutralEvents, trip_event
from gridpeers.plant.feeder.limit_events import CurrentLimits, SetPointLimits
from gridpeers.plant.feeder.protection import InService
from gridpeers.plant.feeder.switchboard import LoadBoard, Switchboard
from gridpeers.plant.feeder.synchronism import Closings, Difference
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, PowerLimit
from gridpeers.plant.plant_interface import Reading, RecordedPlant
from gridpeers.wire.messages import OFF, LoadSetting, PlantEvent
from gridpeers.wire.timing import time_of


def hunting_event(name: str) -> PlantEvent:
    text = (
        f"{name} has no steady state at t = 0: its voltage is beyond its dead band without vars, and within it with "
        "the vars of its droop, so Q hunts between both; choose another db_UV_pu, db_OV_pu or V_set0_pu"
    )
    return PlantEvent(t=0.0, kind="warning", subject=name, text=text)


def installed_inverters(network: Network, settings: PlantSettings) -> tuple[Inverter, ...]:
    feeder = network.feeder
    return tuple(
        Inverter(
            name=unit.name,
            kind=unit.kind,
            phases=unit.phases,
            S_b=unit.P_rated,
            V_b=unit.V_nom,
            m_p=unit.m_p,
            m_q=unit.m_q,
            parameters=feeder.parameters_of(unit, settings.gfm, settings.gfl),
            f_nom=feeder.f_nom,
        )
        for unit in network.inverters
    )


class Plant(RecordedPlant):
    """The feeder with its inverters, advanced by control periods.

    `T_c`: control period (s), a multiple of `settings.h`; `record_step`: distance of the recorded rows (s), a multiple
    of h that divides T_c. PlantError if there is no operating point at the start; ValueError if a parameter or name is
    wrong.
    """

    def __init__(self, network: Network, settings: PlantSettings, T_c: float, record_step: float) -> None:
        self.network, self.settings = network, settings
        self.inverters = tuple(unit.name for unit in network.inverters)
        self.tick = 0  # k: the plant is at k T_c
        self._t = 0.0  # its time (s)
        self._row = {name: i for i, name in enumerate(self.inverters)}
        self._T_c, self._h = T_c, settings.h
        self._steps, self._record = round(T_c / settings.h), round(record_step / settings.h)
        self._switches = Switchboard(network, settings.events, settings.h)
        self._circuits, self._islands, self._neutrals = Circuits(network), Islands(network), NeutralEvents(network)
        self._loads = LoadBoard(network, settings.loads, settings.h)
        self._set_points = SetPointLimits()
        self._limits: dict[int, list[PowerLimit]] = {}
        for limit in settings.limits:
            self._limits.setdefault(round(limit.t / settings.h), []).append(limit)
        self._P_rated = np.array([unit.P_rated for unit in network.inverters])
        self._V_nom = np.array([unit.V_nom for unit in network.inverters])
        self._base = np.column_stack([self._P_rated, self._V_nom])  # bases of P_set (W) and V_set (V)
        self._bases: list[tuple[float, float]] = list(map(tuple, self._base.tolist()))
        connected = [not unit.spare for unit in network.inverters]
        self._dynamics = Dynamics(
            self._circuits.of(self._switches.closed),
            installed_inverters(network, settings),
            settings.h,
            connected=connected,
            method=settings.method,
        )
        units = self._dynamics.inverters.units
        self._current_limits = CurrentLimits(self.inverters, tuple(unit.parameters.current_limit for unit in units))
        self._closings = Closings(self._switches, network, self._dynamics, settings.sync_check, settings.h)
        self._in_service = InService(
            settings.protection, self.inverters, self._V_nom, self._dynamics, connected, self._tell, self._settle
        )
        n = len(self.inverters)
        try:
            point = self._dynamics.start(np.full(n, settings.P_set0), V_set=np.full(n, settings.V_set0))
        except NoPowerFlowError as error:
            raise PlantError(f"{error}; {network.weak_loads(error.weak)}; or try another P_set0") from None
        require_within_limits(self._dynamics.inverters, self._dynamics.network.reduction.online)
        self._now = self._dynamics.readings()
        self._rows: list[tuple[float, ...]] = [self._as_row(0, self._now)]
        self._events = self._islands.report_dead(0.0, self._switches.closed, self._dynamics.network.reduction)
        self._events += self._neutrals.report(0.0, self._switches.closed, self._dynamics)
        self._events += [hunting_event(units[i].name) for i in np.flatnonzero(point.on_edge).tolist()]
        # the first scheduled networks are factored now: in real time an event must not be late
        for circuit in islice(self._foreseen(), KEPT - 1):
            self._dynamics.network.reduced(circuit)

    def load_step(self) -> None:
        """Compile or load the inner loop now; else the first `advance` does, which takes seconds in its first use."""
        self._dynamics.run(0)

    # ---------------------------------------------------------------- for agents

    def measure(self) -> dict[str, Reading]:
        reduction = self._dynamics.network.reduction
        islands = zip(*self._islands.names(reduction), reduction.online.tolist(), strict=True)
        held = (self._dynamics.inverters.set_points[:, :2] * self._base).tolist()
        readings = {}
        for name, (f, P, Q, V), (P_set, V_set), (island, sourced, online) in zip(
            self.inverters, self._now.tolist(), held, islands, strict=True
        ):
            readings[name] = Reading(P, Q, V, f, P_set, V_set, sourced, island if online else OFF)
        return readings

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V), in force from the next step until the next ones, within the inverter's bounds.

        A value beyond its bounds is limited, and one that is not finite is ignored; each is an event, once per spell. A
        tripped inverter accepts none: it returns at no load.
        """
        i, t = self._row[name], self._t
        if not (isfinite(P_set) and isfinite(V_set)):
            self._events += self._set_points.refused(name, t)
            return
        if self._in_service.has_tripped(i):
            return
        P_rated, V_nom = self._bases[i]
        P, V = self._dynamics.inverters.hold(i, P_set / P_rated, V_set / V_nom)
        if events := self._set_points.held(name, t, "P_set", P_set / 1e3, P * P_rated / 1e3):
            self._events += events
        if events := self._set_points.held(name, t, "V_set", V_set, V * V_nom):
            self._events += events

    @property
    def switches(self) -> dict[str, bool]:
        return self._switches.positions

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        """Operate a switch now ("open" or "close"), by its name or alias, from the next step on.

        A closing switch joins two live islands as they are, and a warning gives their differences; with `synchronised`
        it closes only if they are in step. Return whether it was in that state already, or will be by another command
        since the last step. ValueError if there is no such switch, or its sides are not in step.
        """
        known = self.network.switch_name(name)
        if synchronised and action == "close" and (refusal := self._closings.refusal(known)):
            raise ValueError(refusal)
        step, closed = self.tick * self._steps, self._switches.closed
        for at, then in zip(sorted(self._switches.steps), self._switches.foreseen(), strict=True):
            closed = then if at <= step else closed
        self._switches.put(step, known, action, synchronised=synchronised)
        return (known in closed) == (action == "close")

    @property
    def loads(self) -> dict[str, complex]:
        return self._loads.changed

    def set_load(self, name: str, setting: LoadSetting) -> str:
        return self._loads.put(name, setting)

    def difference_across(self, name: str) -> Difference | None:
        return self._closings.difference(self.network.switch_name(name))

    def connect(self, name: str, on: bool) -> None:
        self._in_service.connect(self._row[name], self.tick * self._steps, on=on)

    def advance(self) -> None:
        """Advance to the next tick, with the switches and loads of these steps, scheduled or set by people.

        An island whose network has no solution is de-energised. Steps are split where a clearing time ends, so that
        protection acts at that very step.
        """
        first, last = self.tick * self._steps, (self.tick + 1) * self._steps
        self._events += self._closings.check_waiting(first)
        planned = (*self._switches.steps, *self._limits, *self._loads.steps)
        scheduled = [s for s in planned if first < s < last]
        step = first
        while step < last:
            self._change_network(step)
            for limit in self._limits.get(step, ()):
                self._limit(limit)
            stop = min([last, step + self._in_service.quiet, *(s for s in scheduled if s > step)])
            out = self._dynamics.run(stop - step)
            if (limiting := out[:, :, 6] > 0.0).any():
                for k in np.flatnonzero(limiting.any(axis=1)).tolist():
                    self._events += self._current_limits.report(self._time(step + k + 1), limiting[k])
            self._tell_trips(step)
            for k in range(stop - step):
                if (step + k + 1) % self._record == 0:
                    self._rows.append(self._as_row(step + k + 1, out[k, :, :4]))
            self._now = out[-1, :, :4].copy()
            self._in_service.watch(stop, out)
            step = stop
        self.tick += 1
        self._t = time_of(self.tick, self._T_c)

    def close(self) -> None:
        """Do nothing: all of this plant is in this process."""

    def _time(self, step: int) -> float:
        return time_of(step, self._h)

    def _tell(self, step: int, kind: Literal["inverter", "trip"], subject: str, text: str) -> None:
        self._events.append(PlantEvent(t=self._time(step), kind=kind, subject=subject, text=text))

    def _as_row(self, step: int, readings: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> tuple[float, ...]:
        row = np.empty((len(self.inverters), 6))
        row[:, :4] = readings
        row[:, 4:] = self._dynamics.inverters.set_points[:, :2] * self._base
        return (self._time(step), *row.ravel().tolist())

    # ---------------------------------------------------------------- events of the schedule

    def _foreseen(self) -> Iterator[Circuit]:
        """Yield the circuit after each step with scheduled switches or loads, in the order of time."""
        closed, network = self._switches.closed, self.network
        switched = dict(zip(sorted(self._switches.steps), self._switches.foreseen(), strict=True))
        loaded = dict(self._loads.foreseen())
        for step in sorted({*switched, *loaded}):
            closed, network = switched.get(step, closed), loaded.get(step, network)
            yield self._circuits.of(closed, network)

    def _change_network(self, step: int) -> None:
        loads_change = self._loads.is_due(step)
        if loads_change:
            self.network, events = self._loads.apply(step)
            self._events += events
            self._circuits.change_loads(self.network)
            self._islands.change_loads(self.network)
        switched = step in self._switches.steps and self._operate(step)
        if loads_change and not switched:
            self._dynamics.connect(self._circuits.of(self._switches.closed))
            if self._tell_trips(step):
                self._tell_islands(self._time(step))

    def _operate(self, step: int) -> bool:
        """Operate the switches of this step, all at once, and find the islands again; return whether any moved."""
        t, before = self._time(step), self._switches.closed
        notes, warnings = self._closings.judge(step)
        self._events += warnings
        if not self._switches.due(step):
            return False
        operated = self._switches.operate(step, notes)
        closed = self._switches.closed
        try:
            circuit = self._circuits.of(closed)
        except PlantError as error:  # this network has no solution; the run continues without the switching
            self._switches.closed = before
            names = ", ".join(event.subject for event in operated)
            self._events.append(PlantEvent(t=t, kind="warning", subject=names, text=f"{names} not operated: {error}"))
            return False
        self._events += operated
        self._dynamics.connect(circuit)
        self._tell_trips(step)
        self._tell_islands(t)
        return True

    def _settle(self, step: int, which: list[int]) -> None:
        """Read inverters again that were switched at a step, and report new islands."""
        now = self._dynamics.readings()
        self._now[which] = now[which]
        if self._tell_trips(step):
            self._now = now
        self._tell_islands(self._time(step))

    def _tell_islands(self, t: float) -> None:
        closed = self._switches.closed
        self._events += self._islands.report(t, closed, self._dynamics.network.reduction)
        self._events += self._neutrals.report(t, closed, self._dynamics)

    def _tell_trips(self, step: int) -> bool:
        """Report the trips since `step` of islands without a solution; return whether there were any."""
        trips = self._dynamics.take_trips()
        closed = self._switches.closed
        for trip in trips:
            t = self._time(step + trip.step)
            self._events.append(trip_event(t, trip, self.network, closed, self._closings.joined))
            self._events += self._islands.report_dead(t, closed, self._dynamics.network.reduction)
            self._in_service.note_trips(step + trip.step, list(trip.inverters), before=trip.step)
        return bool(trips)

    def _limit(self, limit: PowerLimit) -> None:
        self._dynamics.inverters.limit_power(self._row[limit.inverter], limit.P_max)
        text = f"{limit.inverter} has {limit.P_max / 1e3:g} kW available"
        self._events.append(PlantEvent(t=round(limit.t, 9), kind="limit", subject=limit.inverter, text=text))
