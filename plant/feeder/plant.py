"""The plant as the rest of the world sees it: measure, take set-points, go one control period on."""

from __future__ import annotations

from math import isfinite
from typing import Literal, NamedTuple

import numpy as np

from plant.dynamics import Dynamics, Inverter, PlantError
from plant.feeder.circuits import Circuits
from plant.feeder.closings import Closings
from plant.feeder.in_service import InService
from plant.feeder.islands import GRID, Islands
from plant.feeder.set_points import SetPointLimits
from plant.feeder.switchboard import Switchboard
from plant.feeder.synchronism import Synchronism
from plant.feeder.trips import trip_event
from plant.network import Network
from plant.plant_config import PlantSettings, PowerLimit
from wire.clock import time_of
from wire.messages import OFF, PlantEvent

__all__ = ["GRID", "Plant", "Reading"]


class Reading(NamedTuple):
    """What the sensors of one inverter read."""

    P: float
    """Real power out (W)."""
    Q: float
    """Reactive power out (var)."""
    V: float
    """Mean terminal voltage (V, line-to-neutral)."""
    f: float
    """Frequency (Hz)."""
    P_set: float
    """Set-point held (W)."""
    V_set: float
    """Set-point held (V)."""
    grid_connected: bool
    """Whether the substation feeds its island."""
    island: str
    """"grid", or the name of the first inverter in its island; `OFF` for one that is off the network or idle."""


class Plant:
    """The feeder with its inverters, advanced by control periods.

    Parameters
    ----------
    network
        The feeder's network.
    settings
        Everything that decides its numbers.
    T_c
        Control period (s), a multiple of `settings.h`.
    record_step
        Distance of the recorded rows (s), a multiple of h that divides T_c.

    Raises
    ------
    PlantError
        If there is no operating point to start from.
    ValueError
        If a parameter or a switch's name is wrong; the message says which.
    """

    def __init__(self, network: Network, settings: PlantSettings, T_c: float, record_step: float) -> None:
        self.network, self.settings = network, settings
        self.inverters = tuple(unit.name for unit in network.inverters)
        self.tick = 0
        """k: the plant stands at k T_c."""
        self._row = {name: i for i, name in enumerate(self.inverters)}
        self._T_c, self._h = T_c, settings.h
        self._steps, self._record = round(T_c / settings.h), round(record_step / settings.h)
        self._switches = Switchboard(network, settings.events, settings.h)
        self._circuits, self._islands = Circuits(network), Islands(network)
        self._set_points = SetPointLimits()
        self._limits: dict[int, list[PowerLimit]] = {}
        for limit in settings.limits:
            self._limits.setdefault(round(limit.t / settings.h), []).append(limit)
        self._P_rated = np.array([unit.P_rated for unit in network.inverters])
        self._V_nom = np.array([unit.V_nom for unit in network.inverters])
        self._dynamics = Dynamics(
            self._circuits.of(self._switches.closed),
            tuple(
                Inverter(
                    name=unit.name,
                    kind=unit.kind,
                    S_b=unit.P_rated,
                    V_b=unit.V_nom,
                    m_p=unit.m_p,
                    m_q=unit.m_q,
                    parameters=settings.gfm if unit.kind == "GFM" else settings.gfl,
                    f_nom=network.feeder.f_nom,
                )
                for unit in network.inverters
            ),
            settings.h,
            connected=[not unit.spare for unit in network.inverters],
        )
        sync = Synchronism(network, self._dynamics, settings.sync_check)
        timeout = round(settings.sync_check.timeout / settings.h)
        self._closings = Closings(self._switches, sync, timeout, settings.h)
        self._in_service = InService(
            settings.protection,
            self.inverters,
            self._V_nom,
            self._dynamics,
            [not unit.spare for unit in network.inverters],
            self._tell,
            self._settle,
        )
        n = len(self.inverters)
        self._dynamics.start(np.full(n, settings.P_set0), V_set=np.full(n, settings.V_set0))
        self._check_start()
        self._now = _truth(self._dynamics.readings())
        self._rows: list[tuple[float, ...]] = [self._as_row(0, self._now)]
        self._events = self._islands.report_dead(0.0, self._switches.closed, self._dynamics.network.reduction)
        # what is scheduled is factored now: in wall-clock time an event must not be late
        for closed in self._switches.foreseen():
            self._dynamics.network.reduced(self._circuits.of(closed))
        self._dynamics.run(0)

    # ---------------------------------------------------------------- what agents see and do

    def measure(self) -> dict[str, Reading]:
        """Read every inverter's sensors at t = tick * T_c."""
        reduction = self._dynamics.network.reduction
        island, sourced = self._islands.names(reduction)
        held = self._dynamics.inverters.set_points
        readings = {}
        for i, name in enumerate(self.inverters):
            f, P, Q, V = self._now[i].tolist()
            P_set, V_set = float(held[i, 0] * self._P_rated[i]), float(held[i, 1] * self._V_nom[i])
            where = island[i] if reduction.online[i] else OFF
            readings[name] = Reading(P, Q, V, f, P_set, V_set, sourced[i], where)
        return readings

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V), in force from the next step until others come, within what the inverter can do.

        What is beyond its bounds is limited, and told once; what is no finite number is left out, and told once.
        An inverter that has tripped takes none: it comes back at no load.
        """
        i, t = self._row[name], time_of(self.tick, self._T_c)
        if not (isfinite(P_set) and isfinite(V_set)):
            self._events += self._set_points.refused(name, t)
            return
        if self._in_service.has_tripped(i):
            return
        P, V = self._dynamics.inverters.hold(i, P_set / self._P_rated[i], V_set / self._V_nom[i])
        self._events += self._set_points.held(name, t, "P_set", P_set / 1e3, P * self._P_rated[i] / 1e3)
        self._events += self._set_points.held(name, t, "V_set", V_set, V * self._V_nom[i])

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        """Operate a switch now ("open" or "close"), by its name or alias; it acts from the next step on.

        Closing two live islands, it joins them as they stand, and a warning tells how far they were apart; with
        `synchronised` only if they are in step.

        Returns
        -------
        bool
            Whether it stood so already, then or by what else was told since the last step.

        Raises
        ------
        ValueError
            If there is no such switch; the message lists those there are. If it was to close in step and is not; the
            message says how far its sides are apart.
        """
        known = self.network.switch_name(name)
        if synchronised and action == "close" and (refusal := self._closings.refusal(known)):
            raise ValueError(refusal)
        step, closed = self.tick * self._steps, self._switches.closed
        for at, then in zip(sorted(self._switches.steps), self._switches.foreseen(), strict=True):
            closed = then if at <= step else closed
        self._switches.put(step, known, action, synchronised=synchronised)
        return (known in closed) == (action == "close")

    def connect(self, name: str, on: bool) -> None:
        """Put an inverter on the network, at zero current and in step with it, or take it off; see `InService`."""
        self._in_service.connect(self._row[name], self.tick * self._steps, on=on)

    def advance(self) -> None:
        """Go to the next tick; switches whose time comes are operated on the way.

        An island whose network has no solution is de-energised and told as an event; the others go on. Protection acts
        at the very step at which a clearing time is over: the steps are cut there.
        """
        first, last = self.tick * self._steps, (self.tick + 1) * self._steps
        self._events += self._closings.check_waiting(first)
        scheduled = sorted({s for s in (*self._switches.steps, *self._limits) if first < s < last} | {last})
        step = first
        while step < last:
            if step in self._switches.steps:
                self._operate(step)
            for limit in self._limits.get(step, ()):
                self._limit(limit)
            stop = min(min(s for s in scheduled if s > step), step + self._in_service.quiet)
            out = self._dynamics.run(stop - step)
            self._tell_trips(step)
            for k in range(stop - step):
                if (step + k + 1) % self._record == 0:
                    self._rows.append(self._as_row(step + k + 1, _truth(out[k])))
            self._now = _truth(out[-1])
            self._in_service.watch(stop, out)
            step = stop
        self.tick += 1

    # ---------------------------------------------------------------- what the recorder sees

    def take_rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows recorded since the last call.

        Each is t (s), then for each inverter f (Hz), P (W), Q (var), V (V), P_set (W), V_set (V).
        """
        rows, self._rows = tuple(self._rows), []
        return rows

    def take_events(self) -> tuple[PlantEvent, ...]:
        """Events since the last call."""
        events, self._events = tuple(self._events), []
        return events

    def _time(self, step: int) -> float:
        """Time of a step (s)."""
        return time_of(step, self._h)

    def _tell(self, step: int, kind: Literal["inverter", "trip"], subject: str, text: str) -> None:
        self._events.append(PlantEvent(t=self._time(step), kind=kind, subject=subject, text=text))

    def _check_start(self) -> None:
        """Refuse a start that is no equilibrium: a GFM that holds up an island must not be beyond its limits there."""
        units = self._dynamics.inverters
        for k, i in enumerate(units.gfm_at.tolist()):
            if not self._dynamics.network.reduction.online[i]:
                continue
            limits, state, P_rated = units.gfm[k], units.gfm_state[k], self._P_rated[i] / 1e3
            for what, value, base, unit, low, high in (
                ("give", units.set_points[i, 0], P_rated, "kW", "P_min", "P_max"),
                ("give", state["q"], P_rated, "kvar", "Q_min", "Q_max"),
                ("have an internal voltage of", state["E"], 1.0, "pu", "E_min", "E_max"),
            ):
                if not limits[low] - 1e-9 <= value <= limits[high] + 1e-9:
                    raise PlantError(
                        f"no equilibrium at t = 0: {self.inverters[i]} would have to {what} {value * base:.5g} {unit}, "
                        f"it can from {limits[low] * base:.5g} to {limits[high] * base:.5g} {unit} ({low}_pu, "
                        f"{high}_pu of [plant.gfm]); set another P_set0_pu or V_set0_pu, or change its load"
                    )

    def _as_row(self, step: int, readings: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> tuple[float, ...]:
        set_points = self._dynamics.inverters.set_points[:, :2] * np.column_stack([self._P_rated, self._V_nom])
        return (self._time(step), *np.hstack([readings, set_points]).ravel().tolist())

    # ---------------------------------------------------------------- events of the schedule

    def _operate(self, step: int) -> None:
        """Operate the switches of this step, all at once, then find the islands anew."""
        t, before = self._time(step), self._switches.closed
        notes, warnings = self._closings.judge(step)
        self._events += warnings
        if not self._switches.due(step):
            return
        told = self._switches.operate(step, notes)
        closed = self._switches.closed
        try:
            circuit = self._circuits.of(closed)
        except PlantError as error:  # such a network cannot be solved; the run need not end for it
            self._switches.closed = before
            names = ", ".join(event.subject for event in told)
            self._events.append(PlantEvent(t=t, kind="warning", subject=names, text=f"{names} not operated: {error}"))
            return
        self._events += told
        self._dynamics.connect(circuit)
        self._tell_trips(step)
        self._events += self._islands.report(t, closed, self._dynamics.network.reduction)

    def _settle(self, step: int, which: list[int]) -> None:
        """Read inverters anew that were switched at a step, and tell which island who feeds now."""
        now = _truth(self._dynamics.readings())
        self._now[which] = now[which]
        if self._tell_trips(step):
            self._now = now
        self._events += self._islands.report(self._time(step), self._switches.closed, self._dynamics.network.reduction)

    def _tell_trips(self, step: int) -> bool:
        """Tell what was tripped since `step` because its island has no solution. Whether anything was."""
        trips = self._dynamics.take_trips()
        closed = self._switches.closed
        for trip in trips:
            t = self._time(step + trip.step)
            self._events.append(trip_event(t, trip, self.network, closed, self._closings.joined))
            self._events += self._islands.report_dead(t, closed, self._dynamics.network.reduction)
            self._in_service.note_trips(step + trip.step, list(trip.inverters), before=trip.step)
        return bool(trips)

    def _limit(self, limit: PowerLimit) -> None:
        """Change what an inverter has available; it acts from the next step on."""
        self._dynamics.inverters.limit_power(self._row[limit.inverter], limit.P_max)
        text = f"{limit.inverter} has {limit.P_max / 1e3:g} kW available"
        self._events.append(PlantEvent(t=round(limit.t, 9), kind="limit", subject=limit.inverter, text=text))


def _truth(
    readings: np.ndarray[tuple[int, int], np.dtype[np.float64]],
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Readings f, P, Q, V of each inverter; where there is no voltage there is no frequency: 0 Hz."""
    told = readings[:, :4].copy()
    told[told[:, 3] == 0.0, 0] = 0.0
    return told
