"""The plant as the rest of the world sees it: measure, take set-points, go one control period on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from plant.config import PlantSettings, PowerLimit
from plant.dynamics import Circuit, Dynamics, Inverter, PlantError
from plant.loads import LoadBranches
from plant.network import Network
from wire.messages import PlantEvent

GRID = "grid"
"""Name of the island that the substation feeds."""


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
    """"grid", or the name of the first inverter in its island."""


def circuit_of(network: Network, closed: frozenset[str], loads: LoadBranches) -> Circuit:
    """The circuit of a feeder with these switches closed.

    Raises
    ------
    PlantError
        If an inverter is tied to another through ideal devices: nothing would decide how they share.
    """
    merge = network.merge(closed)
    on = loads.on(merge)
    n, m = len(network.nodes), len(on)
    branch = np.arange(m)
    delta = on.n_to >= 0
    C = sp.csc_array(
        (
            np.concatenate([on.a_from, -on.a_to[delta]]),
            (np.concatenate([on.n_from, on.n_to[delta]]), np.concatenate([branch, branch[delta]])),
        ),
        shape=(n, m),
    )
    raw = np.array([[network.index(unit.bus, phase) for phase in "ABC"] for unit in network.inverters], np.int64)
    raw = raw.reshape(-1, 3)
    terminals = merge.representative[raw]
    owner: dict[int, str] = {}
    for unit, nodes, at in zip(network.inverters, terminals, raw, strict=True):
        if int(nodes[0]) in owner or not np.allclose(merge.ratio[at], 1.0):
            raise PlantError(
                f"{unit.name} at bus {unit.bus} is tied to {owner.get(int(nodes[0]), 'another source')} by closed "
                "switches or a regulator, without any impedance between them: move it behind a line"
            )
        owner[int(nodes[0])] = unit.name
    return Circuit(
        Y=network.admittance(closed),
        sources=network.source_nodes,
        source_voltage=network.source_voltage,
        terminals=terminals,
        C=C,
        S=on.S,
        I0=on.I0,
        V_branch=on.V_nom * np.exp(1j * on.phi0),
    )


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
        self._closed = network.closed0
        self._loads = network.loads()
        self._circuits: dict[frozenset[str], Circuit] = {}
        self._schedule: dict[int, list[tuple[str, str]]] = {}
        for event in settings.events:
            step = round(event.t / settings.h)
            self._schedule.setdefault(step, []).append((network.switch_name(event.switch), event.action))
        self._limits: dict[int, list[PowerLimit]] = {}
        for limit in settings.limits:
            self._limits.setdefault(round(limit.t / settings.h), []).append(limit)
        self._P_rated = np.array([unit.P_rated for unit in network.inverters])
        self._V_nom = np.array([unit.V_nom for unit in network.inverters])
        self._dynamics = Dynamics(
            self._circuit(self._closed),
            tuple(
                Inverter(
                    name=unit.name,
                    kind=unit.kind,
                    S_b=unit.P_rated,
                    V_b=unit.V_nom,
                    m_p=unit.m_p,
                    m_q=unit.m_q,
                    parameters=settings.gfm if unit.kind == "GFM" else settings.gfl,
                )
                for unit in network.inverters
            ),
            settings.h,
            connected=[not unit.spare for unit in network.inverters],
        )
        n = len(self.inverters)
        self._dynamics.start(np.full(n, settings.P_set0), V_set=np.full(n, settings.V_set0))
        self._now = self._dynamics.readings()
        self._rows: list[tuple[float, ...]] = [self._as_row(0, self._now)]
        self._events: list[PlantEvent] = []
        self._dead: list[str] = []
        self._report_dead(0.0)

        self._foresee()
        self._dynamics.run(0)

    def _foresee(self) -> None:
        """Factor the network of every scheduled switch state now: in wall-clock time an event must not be late."""
        closed = self._closed
        for step in sorted(self._schedule):
            for name, action in self._schedule[step]:
                closed = closed | {name} if action == "close" else closed - {name}
            self._dynamics.reduced(self._circuit(closed))

    # ---------------------------------------------------------------- what agents see and do

    def measure(self) -> dict[str, Reading]:
        """Read every inverter's sensors at t = tick * T_c."""
        island, sourced = self._islands()
        sp_now = self._dynamics.set_points
        readings = {}
        for i, name in enumerate(self.inverters):
            f, P, Q, V = self._now[i].tolist()
            P_set, V_set = float(sp_now[i, 0] * self._P_rated[i]), float(sp_now[i, 1] * self._V_nom[i])
            readings[name] = Reading(P, Q, V, f, P_set, V_set, sourced[i], island[i])
        return readings

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V), in force from the next step until others come."""
        i = self._row[name]
        self._dynamics.set_points[i, 0] = P_set / self._P_rated[i]
        self._dynamics.set_points[i, 1] = V_set / self._V_nom[i]

    def switch(self, name: str, action: str) -> None:
        """Operate a switch now ("open" or "close"), by its name or alias; it acts from the next step on.

        Raises
        ------
        ValueError
            If there is no such switch; the message lists those there are.
        """
        self._schedule.setdefault(self.tick * self._steps, []).append((self.network.switch_name(name), action))

    def connect(self, name: str, on: bool) -> None:
        """Put an inverter on the network, at zero current and in step with it, or take it off.

        Raises
        ------
        PlantError
            If the network has no solution then.
        """
        i = self._row[name]
        if bool(self._dynamics.connected[i]) == on:
            return
        self._dynamics.switch_inverter(i, on)
        t = round(self.tick * self._T_c, 9)
        text = f"{name} {'connected, at no load' if on else 'disconnected'}"
        self._events.append(PlantEvent(t=t, kind="inverter", subject=name, text=text))
        self._report_islands(t)
        self._now[i] = self._dynamics.readings()[i]

    def advance(self) -> None:
        """Go to the next tick; switches whose time comes are operated on the way.

        Raises
        ------
        PlantError
            If the network has no solution; the plant is then broken and says where and when.
        """
        first, last = self.tick * self._steps, (self.tick + 1) * self._steps
        stops = sorted({s for s in (*self._schedule, *self._limits) if first < s < last} | {last})
        step = first
        for stop in stops:
            try:
                if step in self._schedule:
                    self._operate(step)
                for limit in self._limits.get(step, ()):
                    self._limit(limit)
                out = self._dynamics.run(stop - step)
            except PlantError as error:
                raise PlantError(f"plant at t = {step * self._h:.3f} s: {error}") from None
            for k in range(stop - step):
                if (step + k + 1) % self._record == 0:
                    self._rows.append(self._as_row(step + k + 1, out[k]))
            self._now = out[-1]
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

    def _as_row(self, step: int, readings: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> tuple[float, ...]:
        set_points = self._dynamics.set_points[:, :2] * np.column_stack([self._P_rated, self._V_nom])
        # the time is rounded to the nanosecond, so that 0.06 is written and not 0.06000000000000001
        return (round(step * self._h, 9), *np.hstack([readings, set_points]).ravel().tolist())

    # ---------------------------------------------------------------- switching

    def _circuit(self, closed: frozenset[str]) -> Circuit:
        if closed not in self._circuits:
            self._circuits[closed] = circuit_of(self.network, closed, self._loads)
        return self._circuits[closed]

    def _operate(self, step: int) -> None:
        """Operate the switches of this step, all at once, then find the islands anew."""
        t = round(step * self._h, 9)
        for name, action in self._schedule[step]:
            known = name in self._closed
            already = known == (action == "close")
            self._closed = self._closed | {name} if action == "close" else self._closed - {name}
            alias = self.network.switches[name].alias
            shown = f"{alias} ({name})" if alias else name
            text = (
                f"switch {shown} was {'closed' if known else 'open'} already"
                if already
                else f"switch {shown} {_PAST[action]}"
            )
            self._events.append(PlantEvent(t=t, kind="switch", subject=name, text=text))
        self._dynamics.connect(self._circuit(self._closed))
        self._report_islands(t)

    def _limit(self, limit: PowerLimit) -> None:
        """Change what an inverter has available; it acts from the next step on."""
        self._dynamics.limit_power(self._row[limit.inverter], limit.P_max)
        text = f"{limit.inverter} has {limit.P_max / 1e3:g} kW available"
        self._events.append(PlantEvent(t=round(limit.t, 9), kind="limit", subject=limit.inverter, text=text))

    def _report_islands(self, t: float) -> None:
        island, _ = self._islands()
        live = self._dynamics.online
        for name in dict.fromkeys(island):
            members = [
                unit for unit, of, alive in zip(self.inverters, island, live, strict=True) if of == name and alive
            ]
            if members:
                text = f"{'the grid feeds' if name == GRID else 'island of'} {', '.join(members)}"
                self._events.append(PlantEvent(t=t, kind="island", subject=name, text=text))
        self._report_dead(t)

    def _report_dead(self, t: float) -> None:
        """Tell of the buses that nothing feeds any more, and of the inverters and loads on them."""
        dead = self._dead_buses()
        new = [bus for bus in dead if bus not in set(self._dead)]
        if new:
            lost = sum(load.S[p].real for load in self.network.feeder.loads if load.bus in new for p in range(3)) / 1e3
            some = ", ".join(new[:6]) + (", ..." if len(new) > 6 else "")
            idle = [unit.name for unit in self.network.inverters if unit.bus in new]
            text = f"dead: {len(new)} buses ({some}) without substation or GFM, {lost:.0f} kW of load not served"
            text += f", {', '.join(idle)} idle" if idle else ""
            self._events.append(PlantEvent(t=t, kind="dead", subject=new[0], text=text))
        self._dead = dead

    def _islands(self) -> tuple[list[str], list[bool]]:
        """Each inverter's island by name, and whether the substation feeds it."""
        reduction = self._dynamics.reduction
        label = reduction.inverter_island.tolist()
        sourced = [bool(reduction.has_source[k]) for k in label]
        first: dict[int, str] = {}
        for k, name, fed in zip(label, self.inverters, sourced, strict=True):
            first.setdefault(k, GRID if fed else name)
        return [first[k] for k in label], sourced

    def _dead_buses(self) -> list[str]:
        """Buses that nothing feeds, in the feeder's order."""
        merge, reduction = self.network.merge(self._closed), self._dynamics.reduction
        alive = reduction.live[reduction.label[merge.representative]]
        fed = {bus for (bus, _), on in zip(self.network.nodes, alive.tolist(), strict=True) if on}
        return [bus.name for bus in self.network.feeder.buses if bus.name not in fed]


_PAST = {"open": "opened", "close": "closed"}
