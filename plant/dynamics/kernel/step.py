"""The plant's inner loop, compiled: two network solutions and two controller passes a step (section 5)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from plant.dynamics.kernel.arithmetic import A120
from plant.dynamics.kernel.compiled import compiled
from plant.dynamics.kernel.gfl import advance_gfl
from plant.dynamics.kernel.gfm import advance_gfm
from plant.dynamics.kernel.solve import solve_network

READING = 6
"""Numbers per inverter and step: f (Hz), P (W), Q (var), mean V (V), and V of the lowest and the highest phase (V)."""

FAILURES = 3
"""What can fail in a step: 0 the first network solution, 1 the second, 2 a controller whose frequency is not finite."""


@compiled
def read_voltage(V: NDArray[np.complex128], reading: NDArray[np.float64]) -> None:
    """Write the mean of the phases' voltages, the lowest and the highest (V) into an inverter's reading."""
    a, b, c = abs(V[0]), abs(V[1]), abs(V[2])
    reading[3], reading[4], reading[5] = (a + b + c) / 3.0, min(a, b, c), max(a, b, c)


@compiled
def read_terminal(
    y_f: complex,
    J: NDArray[np.complex128],
    V: NDArray[np.complex128],
    I: NDArray[np.complex128],  # noqa: E741  # the paper's symbol
    reading: NDArray[np.float64],
) -> None:
    """Write an inverter's phase currents (A), and P (W), Q (var) and V (V) into its reading (section 2)."""
    S = 0.0j
    for phase in range(3):
        I[phase] = J[phase] - y_f * V[phase]
        S += V[phase] * I[phase].conjugate()
    reading[1], reading[2] = S.real, S.imag
    read_voltage(V, reading)


@compiled
def run_steps(
    begin: int,
    steps: int,
    h: float,
    f_nom: float,
    tolerance: float,
    net: Any,
    gfm: Any,
    gfm_at: NDArray[np.int64],
    gfm_state: Any,
    gfm_0: Any,
    gfm_d: Any,
    gfl: Any,
    gfl_at: NDArray[np.int64],
    gfl_state: Any,
    gfl_0: Any,
    gfl_d: Any,
    online: NDArray[np.bool_],
    set_points: NDArray[np.float64],
    J: NDArray[np.complex128],
    J_0: NDArray[np.complex128],
    V: NDArray[np.complex128],
    I: NDArray[np.complex128],  # noqa: E741  # the paper's symbol
    x: NDArray[np.float64],
    out: NDArray[np.float64],
) -> int:
    """Advance to the end of `steps` steps; returns the network iterations, or -1 - (FAILURES k + what) for step k.

    A solution that failed leaves everything as it stood before it: with another tangent in `net`, a call with
    `begin` = 2 k + what goes on there. The start of step k is in `gfm_0`, `gfl_0` and `J_0`.

    Parameters
    ----------
    begin
        Network solution to begin with, two a step.
    steps, h
        Number of steps and their length (s).
    f_nom
        Nominal frequency (Hz).
    tolerance
        Of the network solution (V).
    net
        A `plant.dynamics.reduced.Reduced`.
    gfm, gfm_at, gfm_state
        Records of `plant.dynamics.kernel.gfm.PARAMETERS`, the inverter each belongs to, and their states.
    gfm_0, gfm_d
        Their states at the start of the step, and the first pass' slopes; written here.
    gfl, gfl_at, gfl_state, gfl_0, gfl_d
        The same for `plant.dynamics.kernel.gfl`.
    online
        Inverters that are connected and in a live island.
    set_points
        n_inv x 3: P_set, V_set, Q_set (pu).
    J
        Injections (A), n_inv x 3: in, the last corrector's; out, the new ones.
    J_0
        Injections (A) at the start of the step, written here.
    V
        Terminal voltages (V), n_inv x 3, of the last network solution.
    I
        Currents out of the inverters (A), n_inv x 3, of the last network solution.
    x
        Branch voltages in the islands' frames, the first guess of the next solution.
    out
        steps x n_inv x READING: each step's f of the corrector; P, Q and V of the second solution. An inverter that
        delivers nothing reads `f_nom`, or 0 Hz where there is no voltage.
    """
    n = J.shape[0]
    m = net.S.size
    work = np.empty(12 * n + 6 * m)
    I_b = np.empty(m, np.complex128)
    x_0 = np.empty_like(x)
    rotation = np.empty(net.leader.size, np.complex128)
    theta = np.zeros(n)
    total = 0
    for solution in range(begin, 2 * steps):
        step = solution // 2
        second = solution % 2 == 1
        if not second:
            for k in range(gfm_at.size):
                gfm_0[k] = gfm_state[k]
            for k in range(gfl_at.size):
                gfl_0[k] = gfl_state[k]
            J_0[:] = J
        for k in range(gfm_at.size):
            theta[gfm_at[k]] = gfm_state[k].theta
        for island in range(net.leader.size):
            rotation[island] = 1.0
            if net.leader[island] >= 0:
                rotation[island] = np.exp(-1j * (theta[net.leader[island]] - net.theta_lin[island]))
        x_0[:] = x
        iterations = solve_network(net, J, rotation, x, I_b, V, tolerance, work)
        if iterations < 0:
            x[:] = x_0
            return -1 - (FAILURES * step + solution % 2)
        total += iterations

        for k in range(gfm_at.size):
            i = gfm_at[k]
            if not online[i]:
                continue
            former = gfm[k]
            read_terminal(former.y_f, J[i], V[i], I[i], out[step, i])
            state = gfm_state[k]
            advance_gfm(
                former,
                set_points[i, 0],
                set_points[i, 1],
                gfm_0[k],
                state,
                gfm_d[k],
                out[step, i, 1] / former.S_b,
                out[step, i, 2] / former.S_b,
                out[step, i, 3] / former.V_b,
                h,
                second,
            )
            J_A = state.E * former.V_b * np.exp(1j * state.theta) * former.y_f
            J[i, 0], J[i, 1], J[i, 2] = J_A, J_A * A120.conjugate(), J_A * A120
            out[step, i, 0] = f_nom + state.w / (2.0 * np.pi)

        for k in range(gfl_at.size):
            i = gfl_at[k]
            if not online[i]:
                continue
            follower = gfl[k]
            read_terminal(follower.y_f, J[i], V[i], I[i], out[step, i])
            J[i, 0], J[i, 1], J[i, 2] = advance_gfl(
                follower,
                set_points[i, 0],
                set_points[i, 1],
                set_points[i, 2],
                gfl_0[k],
                gfl_state[k],
                gfl_d[k],
                V[i, 0],
                V[i, 1],
                V[i, 2],
                J[i, 0],
                J[i, 1],
                J[i, 2],
                h,
                second,
            )
            out[step, i, 0] = gfl_state[k].f

        if second:
            for i in range(n):
                if not online[i]:
                    read_voltage(V[i], out[step, i])
                    # where there is no voltage there is no frequency
                    out[step, i, 0] = f_nom if out[step, i, 3] > 0.0 else 0.0
                    out[step, i, 1], out[step, i, 2] = 0.0, 0.0
                elif not np.isfinite(out[step, i, 0]):
                    return -1 - (FAILURES * step + 2)
    return total
