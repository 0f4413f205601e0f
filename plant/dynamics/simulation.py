"""Inverters on a circuit, advanced in time: the state arrays around the compiled inner loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from plant.config import GflParameters, GfmParameters
from plant.dynamics import gfl as gfl_model
from plant.dynamics import gfm as gfm_model
from plant.dynamics.arithmetic import A120, OMEGA_0
from plant.dynamics.circuit import Circuit
from plant.dynamics.initial import PHASES, OperatingPoint, PlantError, Units, equilibrium
from plant.dynamics.reduction import Complex, Real, Reduction
from plant.dynamics.solve import solve_network
from plant.dynamics.step import READING, run_steps

TOLERANCE = 1e-11
"""Largest change of a voltage in a network solution's last iteration (pu of the highest nominal)."""


@dataclass(frozen=True, kw_only=True)
class Inverter:
    """One inverter at a circuit's terminal."""

    name: str
    """For messages."""
    kind: Literal["GFM", "GFL"]
    S_b: float
    """Rating, base of its per-unit quantities (VA)."""
    V_b: float
    """Nominal voltage (V, line-to-neutral)."""
    m_p: float
    """P-f droop (pu per pu)."""
    m_q: float
    """Q-V droop (pu per pu)."""
    parameters: GfmParameters | GflParameters
    """Of its kind."""


class Dynamics:
    """Inverters and network, stepped with fixed h.

    Parameters
    ----------
    circuit
        The network at the start.
    inverters
        One per row of `circuit.terminals`.
    h
        Step (s).
    connected
        Which inverters are switched on at the start; all by default.

    Notes
    -----
    Call `start` once; then `run` and, at switching, `connect`. `set_points` (n_inv x 3: P_set, V_set, Q_set in
    pu) may be written between runs.
    """

    def __init__(
        self, circuit: Circuit, inverters: tuple[Inverter, ...], h: float, connected: Sequence[bool] | None = None
    ) -> None:
        self.inverters, self.h = inverters, h
        n = len(inverters)
        self.forming = np.array([unit.kind == "GFM" for unit in inverters], dtype=bool)
        self.gfm_at, self.gfl_at = np.flatnonzero(self.forming), np.flatnonzero(~self.forming)
        self.gfm = np.array([self._pack(i) for i in self.gfm_at.tolist()], gfm_model.PARAMETERS)
        self.gfl = np.array([self._pack(i) for i in self.gfl_at.tolist()], gfl_model.PARAMETERS)
        self.gfm_state = np.zeros(self.gfm_at.size, gfm_model.STATE)
        self.gfl_state = np.zeros(self.gfl_at.size, gfl_model.STATE)
        self.y_f = np.zeros(n, complex)
        self.y_f[self.gfm_at], self.y_f[self.gfl_at] = self.gfm["y_f"], self.gfl["y_f"]
        self.S_b = np.array([unit.S_b for unit in inverters])
        self.V_b = np.array([unit.V_b for unit in inverters])
        self.connected = np.ones(n, bool) if connected is None else np.array(connected, dtype=bool)
        """Inverters switched on; they deliver only in a live island."""
        self.set_points = np.zeros((n, 3))
        self.J = np.zeros((n, 3), complex)
        self.V = np.zeros((n, 3), complex)
        self.I = np.zeros((n, 3), complex)
        self.circuit = circuit
        self._reductions: dict[tuple[int, bytes], Reduction] = {}
        self.reduction = self.reduced(circuit)
        self._V_branch = circuit.V_branch.astype(complex)

    def _pack(self, i: int) -> NDArray[np.void]:
        unit = self.inverters[i]
        if isinstance(unit.parameters, GfmParameters):
            return gfm_model.pack(unit.parameters, unit.S_b, unit.V_b, unit.m_p, unit.m_q)
        return gfl_model.pack(unit.parameters, unit.S_b, unit.V_b, unit.m_p, unit.m_q)

    @property
    def online(self) -> NDArray[np.bool_]:
        """Inverters that are connected and in a live island."""
        return self.reduction.online

    # ---------------------------------------------------------------- start

    def start(
        self, P: Real, Q: Real | None = None, V_set: Real | None = None, *, swing_voltage: Complex = PHASES
    ) -> OperatingPoint:
        """Start from the equilibrium at real powers `P` (pu), and at reactive powers `Q` or set-points `V_set` (pu).

        With `Q` the droops are shifted so that they give it, as GridLAB-D does: V_set := v + m_q q for a
        GFM; V_set := v, Q_set := q for a GFL. With `V_set`, Q_set is 0 and q follows from the droop.
        """
        units = Units(
            S_b=self.S_b,
            V_b=self.V_b,
            y_f=self.y_f,
            m_q=np.array([unit.m_q for unit in self.inverters]),
            forming=self.forming,
            S_max=np.array(
                [
                    unit.parameters.S_max if isinstance(unit.parameters, GflParameters) else np.inf
                    for unit in self.inverters
                ]
            ),
        )
        first = np.zeros(P.size) if Q is None else Q
        point = equilibrium(self.circuit, units, P, first, V_set, swing_voltage=swing_voltage, online=self.connected)
        S = np.sum(point.V * np.conj(point.I), axis=1) / self.S_b
        v = np.mean(np.abs(point.V), axis=1) / self.V_b
        self.J, self.V = point.J.copy(), point.V.copy()
        given_Q = V_set is None
        for i in range(P.size):
            if not self.online[i]:
                self.set_points[i] = P[i], 1.0 if V_set is None else V_set[i], 0.0
            elif self.forming[i]:
                self.set_points[i] = S[i].real, v[i] + units.m_q[i] * S[i].imag, 0.0
            else:
                self.set_points[i] = (
                    (S[i].real, v[i], S[i].imag) if given_Q else (S[i].real, v[i] + units.m_q[i] * S[i].imag, 0.0)
                )
        for k, i in enumerate(self.gfm_at.tolist()):
            if self.online[i]:
                gfm_model.settle(self.gfm[k], self.gfm_state[k], self.J[i, 0], S[i], v[i])
        for k, i in enumerate(self.gfl_at.tolist()):
            if self.online[i]:
                gfl_model.settle(self.gfl[k], self.gfl_state[k], self.V[i], point.I[i], S[i], v[i])
        self._V_branch[self.reduction.branches] = point.V_branch
        self.connect(self.circuit)
        return point

    # ---------------------------------------------------------------- switching

    def reduced(self, circuit: Circuit) -> Reduction:
        """Factor a circuit, once: called ahead of a scheduled event, it takes the work out of the event's step."""
        key = id(circuit), self.connected.tobytes()  # the reduction keeps its circuit, so the id stays its own
        if key not in self._reductions:
            self._reductions[key] = Reduction(circuit, self.y_f, self.forming, self.connected)
        return self._reductions[key]

    def connect(self, circuit: Circuit) -> None:
        """Go on with another network: factor it and find its first solution with the present injections.

        Inverters that lose their source of voltage stop; those that regain it start at zero current,
        in step with the voltage they find.

        Raises
        ------
        PlantError
            If the new network has no solution.
        """
        before = self.online.copy()
        live = np.zeros(circuit.C.shape[1], bool)
        live[self.reduction.branches] = True
        self.circuit = circuit
        self.reduction = self.reduced(circuit)
        stopped, regained = before & ~self.online, self.online & ~before
        self.J[~self.online] = 0.0
        for k, i in enumerate(self.gfm_at.tolist()):
            if regained[i]:
                self._black_start(k)

        theta = self._theta()
        nominal = circuit.V_branch * np.exp(1j * self._island_angle(theta))
        guess = np.where(live & (np.abs(self._V_branch) > 0.1 * np.abs(nominal)), self._V_branch, nominal)
        self._V_branch = guess
        self._solve(theta)
        if regained.any():
            for k, i in enumerate(self.gfl_at.tolist()):
                if regained[i]:
                    v = float(np.mean(np.abs(self.V[i]))) / self.V_b[i]
                    self.J[i] = self.y_f[i] * self.V[i]
                    gfl_model.settle(self.gfl[k], self.gfl_state[k], self.V[i], np.zeros(3, complex), 0.0, v)
            self._solve(theta)
        if stopped.any():
            self.V[~self.reduction.live[self.reduction.inverter_island]] = 0.0

    def switch_inverter(self, i: int, on: bool) -> None:
        """Take an inverter off the network, or put it back at zero current, in step with the voltage there.

        Back, its set-points are those at which it rests there: V_set the terminal's voltage, and the P_set whose
        droop gives no power at the island's frequency. What comes next is a matter of control alone.

        Raises
        ------
        PlantError
            If the network without it, or with it, has no solution.
        """
        if on == bool(self.connected[i]):
            return
        w = self._island_speed(i)
        self.connected[i] = on
        if on:
            v = float(np.mean(np.abs(self.V[i]))) / self.V_b[i]
            self.set_points[i] = w / (self.inverters[i].m_p * OMEGA_0), v if v > 0.1 else 1.0, 0.0
        self.connect(self.circuit)
        if on and self.forming[i]:
            self.gfm_state["w"][self.gfm_at == i] = w
        elif on:  # its PLL has found the island's frequency before the contactor closes
            k = int(np.flatnonzero(self.gfl_at == i)[0])
            self.gfl_state[k]["w_i"] = w
            self.gfl_state[k]["f"] = self.gfl_state[k]["f_m"] = gfl_model.F_NOM + w / (2.0 * np.pi)

    def limit_power(self, i: int, P_max: float) -> None:
        """Bound a grid-following inverter's P reference (W) from the next step on.

        Raises
        ------
        ValueError
            If the inverter is grid-forming: its power is what the network takes, not what a reference says.
        """
        if self.forming[i]:
            raise ValueError(f"{self.inverters[i].name} is grid-forming; only a GFL has a P reference to bound")
        self.gfl["P_max"][self.gfl_at == i] = P_max / self.S_b[i]

    def _island_speed(self, i: int) -> float:
        """Speed (rad/s, relative to nominal) of the island that inverter i stands in; 0 with a source or dead."""
        leader = self.reduction.leader[self.reduction.inverter_island[i]]
        return 0.0 if leader < 0 else float(self.gfm_state["w"][self.gfm_at == leader][0])

    def _black_start(self, k: int) -> None:
        """A GFM that comes back: in step with the voltage it finds, or at its set-point where there is none."""
        i = self.gfm_at[k]
        V_1 = complex(self.V[i] @ np.array([1.0, A120, A120**2])) / 3.0
        if abs(V_1) < 0.1 * self.V_b[i]:
            V_1 = complex(self.set_points[i, 1] * self.V_b[i])
        self.J[i] = V_1 * PHASES * self.gfm[k]["y_f"]
        gfm_model.settle(self.gfm[k], self.gfm_state[k], self.J[i, 0], 0.0, abs(V_1) / self.V_b[i])

    def _theta(self) -> Real:
        theta = np.zeros(len(self.inverters))
        theta[self.gfm_at] = self.gfm_state["theta"]
        return theta

    def _island_angle(self, theta: Real) -> Real:
        """Angle (rad) by which each branch's island is turned, 0 where it has a source or no GFM."""
        leader = self.reduction.leader
        angle = np.array([theta[k] if k >= 0 else 0.0 for k in leader])
        C = self.circuit.C.tocsc()
        first = C.indices[C.indptr[:-1]] if C.shape[1] else np.zeros(0, np.int64)
        return np.asarray(angle[self.reduction.label[first]])

    def _solve(self, theta: Real) -> None:
        """Linearise where the present injections lead, by Newton's method with a fresh tangent each time."""
        branches = self.reduction.branches
        V_b = self._V_branch[branches]
        still = np.ones(self.reduction.count, complex)
        scale = float(self.V_b.max())
        for attempt in range(4):
            self.net = self.reduction.linearise(V_b, self.circuit.source_voltage, theta)
            m = V_b.size
            x = np.concatenate([V_b.real, V_b.imag])
            I_b, work = np.empty(m, complex), np.empty(12 * self.J.shape[0] + 6 * m)
            status = solve_network(self.net, self.J, still, x, I_b, self.V, TOLERANCE * scale, work)
            if status >= 0:
                V_b = x[:m] + 1j * x[m:]
                break
            V_b = (
                self.circuit.V_branch[branches]
                * (1.0 - 0.1 * attempt)
                * np.exp(1j * self._island_angle(theta)[branches])
            )
        else:
            raise PlantError(
                "the network has no solution after switching: the load of an island may be more than its inverters "
                "can feed; switch off load, or start from other set-points"
            )
        self.net = self.reduction.linearise(V_b, self.circuit.source_voltage, theta)
        self._x = np.concatenate([V_b.real, V_b.imag])
        self._V_branch[branches] = V_b

    def set_source(self, source_voltage: Complex) -> None:
        """Move the ideal sources to other phasors (V), topology unchanged."""
        V_b, theta = self._branch_voltages(), self._theta()
        self.net = self.reduction.linearise(V_b, source_voltage, theta)
        self._x = np.concatenate([V_b.real, V_b.imag])

    def _branch_voltages(self) -> Complex:
        """Present voltages of the live branches (V), back in the common frame."""
        m = self._x.size // 2
        leader = self.reduction.leader
        angle = np.where(leader >= 0, self._theta()[leader] - self.net.theta_lin, 0.0)
        turned: Complex = (self._x[:m] + 1j * self._x[m:]) * np.exp(1j * angle)[self.reduction.branch_island]
        return turned

    # ---------------------------------------------------------------- time

    def run(self, steps: int) -> Real:
        """Advance by `steps` steps; returns steps x n_inv x (f in Hz, P in W, Q in var, V in V).

        With 0 steps the inner loop is only compiled or loaded.

        Raises
        ------
        PlantError
            If a network solution does not converge or a voltage is not finite.
        """
        out = np.zeros((steps, len(self.inverters), READING))
        tolerance = TOLERANCE * float(self.V_b.max(initial=1.0))
        status = run_steps(
            steps,
            self.h,
            tolerance,
            self.net,
            self.gfm,
            self.gfm_at,
            self.gfm_state,
            self.gfl,
            self.gfl_at,
            self.gfl_state,
            self.online,
            self.set_points,
            self.J,
            self.V,
            self.I,
            self._x,
            out,
        )
        if status < 0 or not np.isfinite(out[-1:]).all():
            where = f" in step {-1 - status} of {steps}" if status < 0 else ""
            raise PlantError(
                f"the network solution did not converge{where} (lowest terminal voltage "
                f"{np.nanmin(np.abs(self.V) / self.V_b[:, None]):.2f} pu): the load may be more than the inverters "
                "can feed, or the controllers unstable; try a smaller h, other gains, or less load"
            )
        if self._x.size:
            self._V_branch[self.reduction.branches] = self._branch_voltages()
        return out

    def readings(self) -> Real:
        """Present f (Hz), P (W), Q (var), V (V) from the last solution, n_inv x 4, before any step was taken."""
        S = np.sum(self.V * np.conj(self.J - self.y_f[:, None] * self.V), axis=1)
        S[~self.online] = 0.0
        f = np.full(S.size, gfl_model.F_NOM)
        f[self.gfm_at] += self.gfm_state["w"] / (2.0 * np.pi)
        f[self.gfl_at] = np.where(self.online[self.gfl_at], self.gfl_state["f"], gfl_model.F_NOM)
        return np.column_stack([f, S.real, S.imag, np.mean(np.abs(self.V), axis=1)])
