"""Changes of the network: the inverters that stop, and those that start again, in step with the voltage there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from gridpeers.plant.dynamics.circuit import PHASES, Circuit, NoSolutionError, aligned_sum
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.kernel.compiled import Flags
from gridpeers.plant.dynamics.live_network import LiveNetwork


class Trip(NamedTuple):
    """Sources disconnected because their island has no solution."""

    step: int  # number of steps of the present `Dynamics.run` before it
    inverters: tuple[int, ...]  # disconnected inverters
    substation: bool  # whether the substation was disconnected too
    V_min: float  # their lowest terminal voltage before (pu); inf where only the substation was left


def connect(units: Inverters, network: LiveNetwork, circuit: Circuit) -> list[Trip]:
    """Continue with another network from the present injections; return the trips of islands without solution.

    Inverters that lose their source of voltage stop; those that regain it start at zero current, in step with it.
    """
    before = network.reduction.online
    trips: list[Trip] = []
    network.change(circuit)
    while True:
        online = network.reduction.online
        regained = online & ~before
        units.J[~online] = 0.0
        try:
            for i in np.flatnonzero(regained & units.forming).tolist():
                _black_start(units, i)
            followers = regained & ~units.forming
            if (behind_filter := followers & (units.y_f != 0.0)).any():
                _solve_without(behind_filter, units, network)
            units.J[followers] = units.y_f[followers, None] * units.V[followers]
            network.guess()
            network.solve()
            for i in np.flatnonzero(followers).tolist():
                units.I[i] = 0.0
                units.rest(i, 0.0, _mean_voltage(units, i))
            return trips
        except NoSolutionError as error:
            trips.append(_trip(units, network, error.islands, 0))
            network.change(circuit)


def _solve_without(away: Flags, units: Inverters, network: LiveNetwork) -> None:
    """Find the voltages at the open terminals of inverters that are about to return.

    At zero current the internal voltage is that of the open terminal, in each phase.
    """
    connected = units.connected.copy()
    units.connected[away] = False
    try:
        network.change(network.circuit)
        network.guess()
        network.solve()
    finally:
        units.connected[:] = connected
        network.change(network.circuit)


def deenergise(units: Inverters, network: LiveNetwork, islands: Iterable[int], step: int) -> list[Trip]:
    """Disconnect all inverters of these islands; where there are none, the substation, which stays off.

    An island with the substation thus first loses only its inverters: the grid may be able to feed it without them.
    """
    trip = _trip(units, network, islands, step)
    return [trip, *(later._replace(step=step) for later in connect(units, network, network.circuit))]


def _trip(units: Inverters, network: LiveNetwork, islands: Iterable[int], step: int) -> Trip:
    reduction = network.reduction
    numbers = list(islands)
    lost = reduction.online & np.isin(reduction.inverter_island, numbers)
    bare = [k for k in numbers if not lost[reduction.inverter_island == k].any()]
    v = np.abs(units.V[lost]) / units.V_b[lost, None]
    units.connected[lost] = False
    if bare:
        network.substation_on = False
    return Trip(step, tuple(np.flatnonzero(lost).tolist()), bool(bare), float(np.min(v, initial=np.inf)))


def switch_inverters(units: Inverters, network: LiveNetwork, which: Sequence[int], on: bool) -> list[Trip]:
    """Disconnect inverters all at once, or reconnect them at zero current, in step with the voltage there.

    A reconnected inverter gets the set-points at which it rests: V_set is the terminal's voltage, and P_set the value
    whose droop gives no power at the island's frequency. Control decides the rest.
    """
    moved = [i for i in which if on != bool(units.connected[i])]
    if not moved:
        return []
    speed = {i: _island_speed(units, network, i) for i in moved}
    units.connected[moved] = on
    w_nom = 2.0 * np.pi * units.f_nom
    for i in moved if on else ():
        v = _rest_voltage(units, i)
        units.set_points[i] = speed[i] / (units.m_p[i] * w_nom), v if v > 0.1 else 1.0, 0.0
    trips = connect(units, network, network.circuit)
    for i, w in speed.items() if on else ():
        if units.forming[i]:
            units.gfm_state["w"][units.gfm_at == i] = w
        else:  # its PLL has locked to the island's frequency before the contactor closes
            follower = units.gfl_at == i
            for name in ("w_i", "w_i_B", "w_i_C"):
                units.gfl_state[name][follower] = w
            units.gfl_state["f"][follower] = units.gfl_state["f_m"][follower] = units.f_nom + w / (2.0 * np.pi)
    return trips


def _black_start(units: Inverters, i: int) -> None:
    V_1 = complex(aligned_sum(units.V[i])) / 3.0
    if abs(V_1) < 0.1 * units.V_b[i]:
        V_1 = complex(units.set_points[i, 1] * units.V_b[i] * PHASES[units.phase[i]])
    units.J[i], units.I[i] = V_1 * PHASES * units.y_f[i], 0.0
    units.rest(i, 0.0, abs(V_1) / units.V_b[i])


def _island_speed(units: Inverters, network: LiveNetwork, i: int) -> float:
    """Return the speed (rad/s, relative to nominal) of inverter i's island; 0 with a source or if dead."""
    leader = network.reduction.leader[network.reduction.inverter_island[i]]
    return 0.0 if leader < 0 else float(units.gfm_state["w"][units.gfm_at == leader][0])


def _rest_voltage(units: Inverters, i: int) -> float:
    if units.positive_sequence[i] or units.direct[i]:
        return float(abs(aligned_sum(units.V[i]))) / 3.0 / float(units.V_b[i])
    return _mean_voltage(units, i)


def _mean_voltage(units: Inverters, i: int) -> float:
    return float(np.mean(np.abs(units.V[i]))) / float(units.V_b[i])
