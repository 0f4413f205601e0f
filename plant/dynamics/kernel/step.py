"""The plant's inner loop, compiled: two network solutions and two controller passes a step (section 5)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from plant.dynamics.kernel.arithmetic import A120
from plant.dynamics.kernel.compiled import compiled
from plant.dynamics.kernel.gfl import F_NOM, advance_gfl
from plant.dynamics.kernel.gfm import advance_gfm
from plant.dynamics.kernel.solve import solve_network

READING = 4
"""Numbers recorded per inverter and step: f (Hz), P (W), Q (var), V (V)."""


@compiled
def read_terminal(
    y_f: complex,
    J: NDArray[np.complex128],
    V: NDArray[np.complex128],
    I: NDArray[np.complex128],  # noqa: E741  # the paper's symbol
    reading: NDArray[np.float64],
) -> None:
    """Write an inverter's phase currents (A), and P (W), Q (var) and mean V (V) into its reading (section 2)."""
    S = 0.0j
    v = 0.0
    for phase in range(3):
        I[phase] = J[phase] - y_f * V[phase]
        S += V[phase] * I[phase].conjugate()
        v += abs(V[phase])
    reading[1], reading[2], reading[3] = S.real, S.imag, v / 3.0


@compiled
def run_steps(
    steps: int,
    h: float,
    tolerance: float,
    net: Any,
    gfm: Any,
    gfm_at: NDArray[np.int64],
    gfm_state: Any,
    gfl: Any,
    gfl_at: NDArray[np.int64],
    gfl_state: Any,
    online: NDArray[np.bool_],
    set_points: NDArray[np.float64],
    J: NDArray[np.complex128],
    V: NDArray[np.complex128],
    I: NDArray[np.complex128],  # noqa: E741  # the paper's symbol
    x: NDArray[np.float64],
    out: NDArray[np.float64],
) -> int:
    """Advance by `steps` steps; returns the network iterations, or -1 - k if step k did not converge.

    Parameters
    ----------
    steps, h
        Number of steps and their length (s).
    tolerance
        Of the network solution (V).
    net
        A `plant.dynamics.reduction.Reduced`.
    gfm, gfm_at, gfm_state
        Records of `plant.dynamics.kernel.gfm.PARAMETERS`, the inverter each belongs to, and their states.
    gfl, gfl_at, gfl_state
        The same for `plant.dynamics.kernel.gfl`.
    online
        Inverters that are connected and in a live island.
    set_points
        n_inv x 3: P_set, V_set, Q_set (pu).
    J
        Injections (A), n_inv x 3: in, the last corrector's; out, the new ones.
    V
        Terminal voltages (V), n_inv x 3, of the last network solution.
    I
        Currents out of the inverters (A), n_inv x 3, of the last network solution.
    x
        Branch voltages in the islands' frames, the first guess of the next solution.
    out
        steps x n_inv x READING: each step's f of the corrector, P, Q, V of the second solution.
    """
    n = J.shape[0]
    m = net.S.size
    work = np.empty(12 * n + 6 * m)
    I_b = np.empty(m, np.complex128)
    rotation = np.empty(net.leader.size, np.complex128)
    theta = np.zeros(n)
    gfm_0, gfl_0 = gfm_state.copy(), gfl_state.copy()
    gfm_d, gfl_d = gfm_state.copy(), gfl_state.copy()
    total = 0
    for step in range(steps):
        for k in range(gfm_at.size):
            gfm_0[k] = gfm_state[k]
        for k in range(gfl_at.size):
            gfl_0[k] = gfl_state[k]
        for solution in range(2):
            second = solution == 1
            for k in range(gfm_at.size):
                theta[gfm_at[k]] = gfm_state[k].theta
            for island in range(net.leader.size):
                rotation[island] = 1.0
                if net.leader[island] >= 0:
                    rotation[island] = np.exp(-1j * (theta[net.leader[island]] - net.theta_lin[island]))
            iterations = solve_network(net, J, rotation, x, I_b, V, tolerance, work)
            if iterations < 0:
                return -1 - step
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
                out[step, i, 0] = F_NOM + state.w / (2.0 * np.pi)

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

        for i in range(n):
            if not online[i]:
                out[step, i, 0], out[step, i, 1], out[step, i, 2] = F_NOM, 0.0, 0.0
                out[step, i, 3] = (abs(V[i, 0]) + abs(V[i, 1]) + abs(V[i, 2])) / 3.0
    return total
