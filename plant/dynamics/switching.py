"""What happens to the inverters when the network changes: who stops, who starts again, and in step with what."""

from __future__ import annotations

import numpy as np

from plant.dynamics.circuit import Circuit
from plant.dynamics.inverters import Inverters
from plant.dynamics.kernel import gfl as gfl_model
from plant.dynamics.kernel.arithmetic import OMEGA_0
from plant.dynamics.live import LiveNetwork
from plant.dynamics.phasors import PHASES, aligned_sum


def connect(units: Inverters, network: LiveNetwork, circuit: Circuit) -> None:
    """Go on with another network: factor it and find its first solution with the present injections.

    Inverters that lose their source of voltage stop; those that regain it start at zero current,
    in step with the voltage they find.

    Raises
    ------
    PlantError
        If the new network has no solution.
    """
    before = network.reduction.online
    network.change(circuit)
    online = network.reduction.online
    regained = online & ~before
    units.J[~online] = 0.0
    for i in np.flatnonzero(regained & units.forming).tolist():
        _black_start(units, i)
    network.guess()
    network.solve()
    followers = np.flatnonzero(regained & ~units.forming).tolist()
    for i in followers:
        units.J[i], units.I[i] = units.y_f[i] * units.V[i], 0.0
        units.rest(i, 0.0, _mean_voltage(units, i))
    if regained.any():
        network.solve()


def switch_inverter(units: Inverters, network: LiveNetwork, i: int, on: bool) -> None:
    """Take an inverter off the network, or put it back at zero current, in step with the voltage there.

    Back, its set-points are those at which it rests there: V_set the terminal's voltage, and the P_set whose
    droop gives no power at the island's frequency. What comes next is a matter of control alone.

    Raises
    ------
    PlantError
        If the network without it, or with it, has no solution.
    """
    if on == bool(units.connected[i]):
        return
    w = _island_speed(units, network, i)
    units.connected[i] = on
    if on:
        v = _mean_voltage(units, i)
        units.set_points[i] = w / (units.m_p[i] * OMEGA_0), v if v > 0.1 else 1.0, 0.0
    connect(units, network, network.circuit)
    if on and units.forming[i]:
        units.gfm_state["w"][units.gfm_at == i] = w
    elif on:  # its PLL has found the island's frequency before the contactor closes
        follower = units.gfl_at == i
        units.gfl_state["w_i"][follower] = w
        units.gfl_state["f"][follower] = units.gfl_state["f_m"][follower] = gfl_model.F_NOM + w / (2.0 * np.pi)


def _black_start(units: Inverters, i: int) -> None:
    """A GFM that comes back: in step with the voltage it finds, or at its set-point where there is none."""
    V_1 = complex(aligned_sum(units.V[i])) / 3.0
    if abs(V_1) < 0.1 * units.V_b[i]:
        V_1 = complex(units.set_points[i, 1] * units.V_b[i])
    units.J[i], units.I[i] = V_1 * PHASES * units.y_f[i], 0.0
    units.rest(i, 0.0, abs(V_1) / units.V_b[i])


def _island_speed(units: Inverters, network: LiveNetwork, i: int) -> float:
    """Speed (rad/s, relative to nominal) of the island that inverter i stands in; 0 with a source or dead."""
    leader = network.reduction.leader[network.reduction.inverter_island[i]]
    return 0.0 if leader < 0 else float(units.gfm_state["w"][units.gfm_at == leader][0])


def _mean_voltage(units: Inverters, i: int) -> float:
    """Mean terminal voltage of inverter i (pu)."""
    return float(np.mean(np.abs(units.V[i]))) / float(units.V_b[i])
