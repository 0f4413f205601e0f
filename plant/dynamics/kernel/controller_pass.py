"""One pass of all inverters' controllers: from a network solution to the injections of the next one, compiled.

Every method of time stepping consists of such passes. A pass of length 0 writes slopes and outputs at the present
states, which it only holds within their limits. So a model is described once, for every method.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real, compiled, magnitude, unit_phasor
from gridpeers.plant.dynamics.kernel.model_pass import THETA, F, run_pass

READING = 7
"""Numbers per inverter and step: f (Hz), P (W), Q (var), mean V (V), V of the lowest and the highest phase (V), and
whether its phase currents were limited (1 or 0)."""


class Units(NamedTuple):
    """The inverters of a run as the compiled functions take them: tables with a row for each."""

    f_nom: float  # nominal frequency (Hz)
    passes: Integers  # addresses of their models' passes
    parameters: Any  # bytes of `model_pass.parameters_of` their models
    state: Real  # their states, `model_pass.state_of` their models; advanced by a pass
    start: Real  # their states at the start of the step
    slope: Real  # slopes of the step's first pass
    terminal: Any  # records of `model_pass.TERMINAL`
    S_3: Real  # ratings of three phases (VA)
    V_b: Real  # nominal voltages (V)
    y_f: Complex  # admittances of their filters in the network (S)
    I_limit: Real  # limits of their phase currents (A); infinite for none
    online: Flags  # inverters that are connected and in a live island
    set_points: Real  # n_inv x 3: P_set, V_set, Q_set (pu)
    J: Complex  # injections (A), n_inv x 3: in, those of the network solution; out, the new ones
    J_0: Complex  # injections (A) at the start of the step
    V: Complex  # terminal voltages (V), n_inv x 3, of the last network solution
    I: Complex  # noqa: E741  # the paper's symbol; currents out of the inverters (A)
    limiting: Flags  # inverters whose phase currents were limited in the last network solution


ADVANCED = ("state", "J", "V", "I", "limiting")  # Tables that a step advances


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
    """Write an inverter's phase currents (A), and P (W), Q (var) and V (V) into its reading.

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
    for i in range(units.J.shape[0]):
        for k in range(units.state.shape[1]):
            units.start[i, k] = units.state[i, k]
        for phase in range(3):
            units.J_0[i, phase] = units.J[i, phase]


@compiled
def turn_frames(units: Any, net: Any, rotation: Complex) -> None:
    """Write the factor that turns phasors into each island's frame."""
    for island in range(net.leader.size):
        rotation[island] = 1.0
        if net.leader[island] >= 0:
            rotation[island] = unit_phasor(net.theta_lin[island] - units.state[net.leader[island], THETA])


@compiled
def advance_inverters(units: Any, h: float, second: bool, readings: Real) -> None:
    """Take one pass of length `h` (s) of every inverter: V is read; states, J, I and `readings` are written."""
    set_points, J, V, I = units.set_points, units.J, units.V, units.I  # noqa: E741
    width, size, record = units.parameters.shape[1], 8 * units.state.shape[1], units.terminal.itemsize
    g, t, x0 = units.parameters.ctypes.data, units.terminal.ctypes.data, units.start.ctypes.data
    x, d = units.state.ctypes.data, units.slope.ctypes.data
    for i in range(units.online.size):
        if not units.online[i]:
            continue
        read_terminal(i, units.y_f[i], J, V, I, readings)
        at = units.terminal[i]
        at.P_set, at.V_set, at.Q_set = set_points[i, 0], set_points[i, 1], set_points[i, 2]
        at.P, at.Q, at.V = (readings[i, 1] / units.S_3[i], readings[i, 2] / units.S_3[i], readings[i, 3] / units.V_b[i])
        at.V_A, at.V_B, at.V_C = V[i, 0], V[i, 1], V[i, 2]
        at.I_A, at.I_B, at.I_C = I[i, 0], I[i, 1], I[i, 2]
        at.J_A, at.J_B, at.J_C = J[i, 0], J[i, 1], J[i, 2]
        own = i * size
        run_pass(units.passes[i], g + i * width, t + i * record, x0 + own, x + own, d + own, h, second)
        J[i, 0], J[i, 1], J[i, 2] = at.J_A, at.J_B, at.J_C
        readings[i, 0] = units.state[i, F]
        if units.limiting[i]:
            readings[i, 6] = 1.0
