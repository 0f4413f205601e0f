"""One pass of all inverters' controllers: from a network solution to the injections of the next one, compiled.

Every method of time stepping consists of such passes. A pass of length 0 writes slopes and outputs at the present
states, which it only holds within their limits. So a model is described once, for every method.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import (
    A120,
    Complex,
    Flags,
    Integers,
    Real,
    compiled,
    magnitude,
    unit_phasor,
)
from gridpeers.plant.dynamics.kernel.gfl import advance_gfl
from gridpeers.plant.dynamics.kernel.gfm import advance_gfm, measure_positive_sequence

READING = 7
"""Numbers per inverter and step: f (Hz), P (W), Q (var), mean V (V), V of the lowest and the highest phase (V), and
whether its phase currents were limited (1 or 0)."""


class Units(NamedTuple):
    """The inverters of a run as the compiled functions take them."""

    f_nom: float  # nominal frequency (Hz)
    gfm: Any  # records of `gridpeers.plant.dynamics.kernel.gfm.PARAMETERS`
    gfm_at: Integers  # the inverter that each belongs to
    gfm_state: Any  # their states; advanced by a pass
    gfm_0: Any  # their states at the start of the step
    gfm_d: Any  # slopes of the step's first pass
    gfl: Any  # the same for `gridpeers.plant.dynamics.kernel.gfl`
    gfl_at: Integers
    gfl_state: Any
    gfl_0: Any
    gfl_d: Any
    online: Flags  # inverters that are connected and in a live island
    set_points: Real  # n_inv x 3: P_set, V_set, Q_set (pu)
    J: Complex  # injections (A), n_inv x 3: in, those of the network solution; out, the new ones
    J_0: Complex  # injections (A) at the start of the step
    V: Complex  # terminal voltages (V), n_inv x 3, of the last network solution
    I: Complex  # noqa: E741  # the paper's symbol; currents out of the inverters (A)
    limiting: Flags  # inverters whose phase currents were limited in the last network solution


@compiled
def read_voltage(i: int, V: Complex, readings: Real) -> None:
    a, b, c = magnitude(V[i, 0]), magnitude(V[i, 1]), magnitude(V[i, 2])
    readings[i, 3], readings[i, 4], readings[i, 5] = (a + b + c) / 3.0, min(a, b, c), max(a, b, c)


@compiled
def read_terminal(
    i: int,
    y_f: complex,
    J: Complex,
    V: Complex,
    I: Complex,  # noqa: E741  # the paper's symbol
    readings: Real,
) -> None:
    """Write an inverter's phase currents (A), and P (W), Q (var) and V (V) into its reading (section 2).

    The compiled functions take whole tables and a row: each view of a row would count references to its table.
    """
    S = 0.0j
    for phase in range(3):
        I[i, phase] = J[i, phase] - y_f * V[i, phase]
        S += V[i, phase] * I[i, phase].conjugate()
    readings[i, 1], readings[i, 2] = S.real, S.imag
    read_voltage(i, V, readings)


@compiled
def read_offline(units: Any, readings: Real) -> None:
    """Write the readings of the inverters that deliver nothing: `f_nom`, or 0 Hz where there is no voltage."""
    for i in range(units.online.size):
        if not units.online[i]:
            read_voltage(i, units.V, readings)
            readings[i, 0] = units.f_nom if readings[i, 3] > 0.0 else 0.0
            readings[i, 1], readings[i, 2] = 0.0, 0.0


@compiled
def keep_start(units: Any) -> None:
    for k in range(units.gfm_at.size):
        units.gfm_0[k] = units.gfm_state[k]
    for k in range(units.gfl_at.size):
        units.gfl_0[k] = units.gfl_state[k]
    for i in range(units.J.shape[0]):
        for phase in range(3):
            units.J_0[i, phase] = units.J[i, phase]


@compiled
def turn_frames(units: Any, net: Any, theta: Real, rotation: Complex) -> None:
    """Write the factor that turns phasors into each island's frame; `theta`: room for a number an inverter."""
    for k in range(units.gfm_at.size):
        theta[units.gfm_at[k]] = units.gfm_state[k].theta
    for island in range(net.leader.size):
        rotation[island] = 1.0
        if net.leader[island] >= 0:
            rotation[island] = unit_phasor(net.theta_lin[island] - theta[net.leader[island]])


@compiled
def advance_inverters(units: Any, h: float, second: bool, readings: Real) -> None:
    """Take one pass of length `h` (s) of every inverter: V is read; states, J, I and `readings` are written."""
    set_points, J, V = units.set_points, units.J, units.V
    for k in range(units.gfm_at.size):
        i = units.gfm_at[k]
        if not units.online[i]:
            continue
        former = units.gfm[k]
        read_terminal(i, former.y_f, J, V, units.I, readings)
        state = units.gfm_state[k]
        P, Q, v = readings[i, 1] / former.S_b, readings[i, 2] / former.S_b, readings[i, 3] / former.V_b
        if former.positive_sequence:
            P, Q, v = measure_positive_sequence(former, i, V, units.I)
        advance_gfm(
            former, set_points[i, 0], set_points[i, 1], units.gfm_0[k], state, units.gfm_d[k], P, Q, v, h, second
        )
        J_A = state.E * former.V_b * unit_phasor(state.theta) * former.y_f
        J[i, 0], J[i, 1], J[i, 2] = J_A, J_A * A120.conjugate(), J_A * A120
        readings[i, 0] = units.f_nom + state.w / (2.0 * np.pi)
        if units.limiting[i]:
            readings[i, 6] = 1.0

    for k in range(units.gfl_at.size):
        i = units.gfl_at[k]
        if not units.online[i]:
            continue
        follower = units.gfl[k]
        read_terminal(i, follower.y_f, J, V, units.I, readings)
        J[i, 0], J[i, 1], J[i, 2] = advance_gfl(
            follower,
            set_points[i, 0],
            set_points[i, 1],
            set_points[i, 2],
            units.gfl_0[k],
            units.gfl_state[k],
            units.gfl_d[k],
            V[i, 0],
            V[i, 1],
            V[i, 2],
            J[i, 0],
            J[i, 1],
            J[i, 2],
            h,
            second,
        )
        readings[i, 0] = units.gfl_state[k].f
