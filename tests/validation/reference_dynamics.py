"""The plant's equations written a second time and integrated by scipy, with the network solved at every evaluation.

This is the limit of small steps. The inverters' equations are those of `plant/inverters/gfm_droop.py` and `gfl.py`,
without the kernel: arrays over all GFM or all GFL, whose states are rows; what depends at once on the network (terminal
voltages) is an argument. The network is solved by Newton's method at the nodes that carry a load or an inverter: it
uses the admittances of `gridpeers.plant.network` (beside OpenDSS in the part "power-flow"), and none of
`gridpeers.plant.dynamics`' reductions.
"""

from __future__ import annotations

from collections.abc import Sequence
from unittest.mock import patch

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import lu_factor, lu_solve

from gridpeers.plant.dynamics import Circuit, Dynamics, Inverter
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.kernel.controller_pass import READING
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

TURN = np.exp(-2j * np.pi / 3.0 * np.arange(3))  # phases A, B, C of a balanced set
GFM_STATES = ("p", "q", "v", "x_over", "x_under", "y_over", "y_under", "e", "theta")
GFL_STATES = ("w_i", "theta", "f_m", "P_f", "V_m", "Q_f", "cd_A", "cq_A", "cd_B", "cq_B", "cd_C", "cq_C")


class _Kind:
    """Parameters of all inverters of a kind as arrays, by name."""

    def __init__(self, units: Sequence[Inverter]) -> None:
        for name in units[0].parameters.__struct_fields__:
            setattr(self, name, np.array([getattr(unit.parameters, name) for unit in units]))
        self.S_b, self.V_b, self.m_p, self.m_q = (
            np.array([getattr(unit, name) for unit in units]) for name in ("S_b", "V_b", "m_p", "m_q")
        )
        self.f_nom = units[0].f_nom

    def __getattr__(self, name: str) -> Real:
        raise AttributeError(name)


def _held(slope: Real, x: Real, low: Real | float, high: Real | float) -> Real:
    return np.where(((x >= high) & (slope > 0.0)) | ((x <= low) & (slope < 0.0)), 0.0, slope)


class GfmEquations(_Kind):
    """Section 3: droop, limiters, voltage controller."""

    @property
    def y_f(self) -> Complex:
        y_f: Complex = 1.0 / ((self.R_f + 1j * self.X_f) * 3.0 * self.V_b**2 / self.S_b)
        return y_f

    def outputs(self, x: Real, P_set: Real, V_set: Real) -> tuple[Real, Complex, Real]:
        """Return the speed (rad/s), the internal voltages (V), and the voltage controller's error (pu)."""
        p, q, v, x_over, x_under, y_over, y_under, e, theta = x
        w = self.m_p * 2.0 * np.pi * self.f_nom * (P_set - p)
        w = w + np.clip(x_over + self.k_pp * (self.P_max - p), -self.w_lim, 0.0)
        w = w + np.clip(x_under + self.k_pp * (self.P_min - p), 0.0, self.w_lim)
        error = V_set - self.m_q * q - v
        error = error + np.clip(y_over + self.k_pq * (self.Q_max - q), -self.V_lim, 0.0)
        error = error + np.clip(y_under + self.k_pq * (self.Q_min - q), 0.0, self.V_lim)
        E = np.clip(e + self.k_pv * error, self.E_min, self.E_max)
        return w, (E * self.V_b * np.exp(1j * theta))[:, None] * TURN, error

    def slopes(self, x: Real, P_set: Real, V_set: Real, V: Complex) -> Real:
        """Return the time derivatives of the states at these terminal voltages (V)."""
        p, q, v, x_over, x_under, y_over, y_under, e, _ = x
        w, E, error = self.outputs(x, P_set, V_set)
        S = np.sum(V * np.conj((E - V) * self.y_f[:, None]), axis=1) / self.S_b
        v_now = np.mean(np.abs(V), axis=1) / self.V_b
        return np.array(
            [
                (S.real - p) / self.T_p,
                (S.imag - q) / self.T_q,
                (v_now - v) / self.T_v,
                _held(self.k_ip * (self.P_max - p), x_over, -self.w_lim, 0.0),
                _held(self.k_ip * (self.P_min - p), x_under, 0.0, self.w_lim),
                _held(self.k_iq * (self.Q_max - q), y_over, -self.V_lim, 0.0),
                _held(self.k_iq * (self.Q_min - q), y_under, 0.0, self.V_lim),
                _held(self.k_iv * error, e, self.E_min, self.E_max),
                w,
            ]
        )


class GflEquations(_Kind):
    """Section 4, positive sequence, voltage source: PLL, freq-watt, volt-var, current controllers."""

    def u(self, x: Real, V: Complex) -> Complex:
        """Return the positive-sequence voltage in the PLL's frame (pu)."""
        u: Complex = np.mean(V * np.conj(TURN), axis=1) * np.exp(-1j * x[1]) / self.V_b
        return u

    def speed(self, x: Real, V: Complex) -> Real:
        """Return the PLL's speed (rad/s relative to nominal)."""
        w: Real = x[0] + self.k_pPLL * self.u(x, V).imag
        return w

    def current_reference(self, x: Real, V: Complex) -> tuple[Complex, Complex]:
        """Return the reference (dq, pu), and its derivative by u_d."""
        u_d = np.maximum(self.u(x, V).real, 1e-3)
        d, q = x[3] / u_d, -x[5] / u_d
        reference = np.clip(d, -self.i_max, self.i_max) + 1j * np.clip(q, -self.i_max, self.i_max)
        falls = np.where(np.abs(d) < self.i_max, -d, 0.0) + 1j * np.where(np.abs(q) < self.i_max, -q, 0.0)
        return reference, falls / u_d

    def currents(self, x: Real, V: Complex) -> tuple[Complex, Complex]:
        """Return the phase currents (A) that the controllers and filters make at these voltages, and dI / du_d."""
        # E = c + k_pc (i* - i) + u + j X_f F i behind R_f + j X_f: u cancels, and i is what remains
        z = (self.R_f + self.k_pc + 1j * self.X_f * (1.0 - self.F_current))[:, None]
        reference, by_u = self.current_reference(x, V)
        c = (x[6::2] + 1j * x[7::2]).T
        frame = (np.exp(1j * x[1]) * self.S_b / (3.0 * self.V_b))[:, None] * TURN
        return (c + (self.k_pc * reference)[:, None]) / z * frame, (self.k_pc * by_u)[:, None] / z * frame

    def slopes(self, x: Real, P_set: Real, V_set: Real, V: Complex) -> Real:
        """Return the time derivatives of the states at these terminal voltages (V)."""
        _, theta, f_m, P_f, V_m, Q_f = x[:6]
        w = self.speed(x, V)
        df = f_m - self.f_nom
        droop = np.where((-self.db_UF < df) & (df < self.db_OF), 0.0, -df / (self.f_nom * self.m_p))
        P_d = np.clip(P_set + droop, self.P_min, self.P_max)
        inside = (V_set - self.db_UV < V_m) & (V_m < V_set + self.db_OV)
        Q_lim = np.sqrt(np.maximum(self.S_max**2 - P_d**2, 0.0))
        Q_d = np.clip(np.where(inside, 0.0, (V_set - V_m) / self.m_q), -Q_lim, Q_lim)
        v_now = np.mean(np.abs(V), axis=1) / self.V_b
        i = self.currents(x, V)[0] * np.conj(TURN) * (np.exp(-1j * theta) * 3.0 * self.V_b / self.S_b)[:, None]
        dc = (self.k_ic[:, None] * (self.current_reference(x, V)[0][:, None] - i)).T
        return np.array(
            [
                self.k_iPLL * self.u(x, V).imag,
                w,
                (self.f_nom + w / (2.0 * np.pi) - f_m) / self.T_ff,
                (P_d - P_f) / self.T_pf,
                (v_now - V_m) / self.T_vf,
                (Q_d - Q_f) / self.T_qf,
                *(part for phase in dc for part in (phase.real, phase.imag)),
            ]
        )


EXACT = 1e-12  # largest change of a voltage in the last iteration (pu of the largest)


class NetworkEquations:
    """The part of a circuit with voltage; all other nodes are 0, and loads are constant power and constant current.

    `y_f` are the filter admittances (S) of the terminals `formed` (n x 3 nodes), which are behind internal voltages;
    currents are injected into the terminals `fed`.
    """

    def __init__(self, circuit: Circuit, y_f: Complex, formed: NDArray[np.int64], fed: NDArray[np.int64]) -> None:
        assert not circuit.loads.limited_at.size
        _, label = circuit.components()
        live = np.isin(label, label[np.concatenate([circuit.sources, formed.ravel()])])
        free = live.copy()
        free[circuit.sources] = False
        carried = np.zeros(live.size, bool)
        carried[circuit.C.tocoo().row] = carried[formed] = carried[fed] = True
        K, E = np.flatnonzero(free & carried), np.flatnonzero(free & ~carried)
        Y = circuit.Y.toarray()
        empty = np.abs(Y[E]).sum(axis=1) == 0.0  # nodes that are merged into others
        E = E[~empty]
        through = np.linalg.solve(Y[np.ix_(E, E)], np.hstack([Y[np.ix_(E, K)], Y[np.ix_(E, circuit.sources)]]))
        reduced = np.hstack([Y[np.ix_(K, K)], Y[np.ix_(K, circuit.sources)]]) - Y[np.ix_(K, E)] @ through
        place = np.full(live.size, -1, np.int64)
        place[K] = np.arange(K.size)
        C = circuit.C.toarray()
        self.branches = np.flatnonzero(live[np.abs(C).argmax(axis=0)])
        self._C, self._loads = C[np.ix_(K, self.branches)], circuit.loads.of(self.branches)
        self._at_branches = C[np.ix_(circuit.sources, self.branches)].T @ circuit.source_voltage
        self.formed, self.fed, self._y_f = place[formed], place[fed], y_f
        self._Y, self._drawn = reduced[:, : K.size], reduced[:, K.size :] @ circuit.source_voltage
        self._Y[self.formed, self.formed] += y_f[:, None]
        self.nodes = K  # nodes whose voltages are the unknowns
        self.rotates = not circuit.sources.size
        self.factors: tuple[Real, NDArray[np.int32]] | None = None

    def branch_voltages(self, V: Complex) -> Complex:
        """Return the voltages (V) of `branches` from those of the nodes."""
        voltages: Complex = self._C.T @ V + self._at_branches
        return voltages

    def residual(self, V: Complex, E: Complex, currents: Complex) -> Complex:
        """Return the sum of the currents (A) that leave each node."""
        sum_of: Complex = self._Y @ V + self._drawn + self._C @ self._loads.currents(self.branch_voltages(V))
        sum_of[self.formed] -= self._y_f[:, None] * E
        sum_of[self.fed] -= currents
        return sum_of

    def factorise(self, V: Complex, by_voltage: Complex, weights: Complex) -> None:
        """Take the tangent at these voltages; the currents fed change by `by_voltage` Re(sum of weights V)."""
        A, B = self._loads.tangent(self.branch_voltages(V))
        linear, conjugate = self._Y + (self._C * A) @ self._C.T, (self._C * B) @ self._C.T
        J = np.block(
            [
                [(linear + conjugate).real, (conjugate - linear).imag],
                [(linear + conjugate).imag, (linear - conjugate).real],
            ]
        )
        n = V.size
        for at, change, weight in zip(self.fed, by_voltage, weights, strict=True):
            both, row = np.concatenate([at, at + n]), np.concatenate([weight.real, -weight.imag])
            J[np.ix_(both, both)] -= np.outer(np.concatenate([change.real, change.imag]), row)
        self.factors = lu_factor(J)

    def step(self, residual: Complex) -> Complex:
        """Return the Newton step (V) of a residual (A)."""
        assert self.factors is not None
        d = lu_solve(self.factors, -np.concatenate([residual.real, residual.imag]))
        n = residual.size
        step: Complex = d[:n] + 1j * d[n:]
        return step


RELATIVE, ABSOLUTE = 1e-7, 1e-8  # tolerances of the integration (pu, rad, Hz)


class DaeDynamics(Dynamics):
    """Dynamics whose `run` integrates the equations; `h` is the distance of its rows.

    All inverters deliver, one island has voltage, and the GFL are voltage sources with both droops.
    """

    _solved: Circuit | None = None

    def run(self, steps: int) -> Real:
        """Advance by `steps` rows; return as `Dynamics.run`."""
        units = self.inverters
        if not steps:
            return np.zeros((0, len(units), READING))
        self._follow_switching()
        former, follower = self._places()
        start = np.concatenate([_states(units, former, GFM_STATES), _states(units, follower, GFL_STATES)])
        rows = self.h * np.arange(1, steps + 1)
        solution = solve_ivp(
            self.slopes, (0.0, rows[-1]), start, "DOP853", rows, rtol=RELATIVE, atol=ABSOLUTE, vectorized=False
        )
        if not solution.success:
            raise RuntimeError(solution.message)
        return np.array([self._read(x) for x in solution.y.T])

    def slopes(self, t: float, x: Real) -> Real:
        gfm, gfl, _, V = self._algebraic(x)
        P_set, V_set, _ = self.inverters.set_points.T
        former, follower = self._places()
        return np.concatenate(
            [
                self._gfm.slopes(gfm, P_set[former], V_set[former], V[self._network.formed]).ravel(),
                self._gfl.slopes(gfl, P_set[follower], V_set[follower], V[self._network.fed]).ravel(),
            ]
        )

    def _places(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return np.flatnonzero(self.inverters.forming), np.flatnonzero(~self.inverters.forming)

    def _follow_switching(self) -> None:
        """Take over the present network; its first guess is the plant's own solution."""
        units, circuit = self.inverters, self.network.circuit
        if self._solved is circuit:
            return
        assert self.network.reduction.online.all()
        assert not units.single.any()
        self._gfm, self._gfl = GfmEquations(_those(units.units, "GFM")), GflEquations(_those(units.units, "GFL"))
        former, follower = self._places()
        terminals = circuit.terminals
        self._network = NetworkEquations(circuit, self._gfm.y_f, terminals[former], terminals[follower])
        angle = float(units.state_of(int(former[0]))["theta"]) if self._network.rotates else 0.0
        self._V = self.voltages()[self._network.nodes] * np.exp(-1j * angle)
        self._solved = circuit

    def _algebraic(self, x: Real) -> tuple[Real, Real, float, Complex]:
        """Return the states in the frame of the first GFM, its angle (rad), and the nodes' voltages (V) there."""
        units, network = self.inverters, self._network
        former, _ = self._places()
        split = len(GFM_STATES) * former.size
        gfm = x[:split].reshape(len(GFM_STATES), -1).copy()
        gfl = x[split:].reshape(len(GFL_STATES), -1).copy()
        angle = float(gfm[-1, 0]) if network.rotates else 0.0
        gfm[-1] -= angle
        gfl[1] -= angle
        P_set, V_set, _ = units.set_points[former].T
        E = self._gfm.outputs(gfm, P_set, V_set)[1]
        V = self._V
        weights = np.conj(TURN) * np.exp(-1j * gfl[1])[:, None] / (3.0 * self._gfl.V_b)[:, None]
        for count in range(60):
            currents, by_u = self._gfl.currents(gfl, V[network.fed])
            if count % 8 == 7 or network.factors is None:
                network.factorise(V, by_u, weights)
            step = network.step(network.residual(V, E, currents))
            V = V + step
            if np.abs(step).max() <= EXACT * np.abs(V).max():
                self._V = V
                return gfm, gfl, angle, V
        raise RuntimeError("the network has no solution")

    def _read(self, x: Real) -> Real:
        """Take the states into the inverters, and return their readings."""
        units, network = self.inverters, self._network
        former, follower = self._places()
        gfm, gfl, angle, V = self._algebraic(x)
        P_set, V_set, _ = units.set_points[former].T
        w, E, _ = self._gfm.outputs(gfm, P_set, V_set)
        readings = np.zeros((len(units), READING))
        readings[former, 0] = w
        readings[follower, 0] = self._gfl.speed(gfl, V[network.fed])
        readings[:, 0] = units.f_nom + readings[:, 0] / (2.0 * np.pi)
        back = np.exp(1j * angle)
        units.V[former], units.V[follower] = V[network.formed] * back, V[network.fed] * back
        units.J[former] = self._gfm.y_f[:, None] * E * back
        units.J[follower] = self._gfl.currents(gfl, V[network.fed])[0] * back
        S = np.sum(units.V * np.conj(units.J - units.y_f[:, None] * units.V), axis=1)
        magnitude = np.abs(units.V)
        readings[:, 1], readings[:, 2] = S.real, S.imag
        readings[:, 3], readings[:, 4], readings[:, 5] = magnitude.mean(1), magnitude.min(1), magnitude.max(1)
        gfm[-1] += angle
        gfl[1] += angle
        for places, names, rows in ((former, GFM_STATES, gfm), (follower, GFL_STATES, gfl)):
            for i, column in zip(places.tolist(), rows.T, strict=True):
                for name, value in zip(names, column, strict=True):
                    units.state_of(i)[name] = value
        for i, speed in zip(former.tolist(), w, strict=True):
            units.state_of(i)["w"] = speed
        return readings


def reference_plant(network: Network, settings: PlantSettings, T_c: float, record_step: float) -> Plant:
    """Return our plant with switches, set-points and readings, but with `DaeDynamics`."""
    with patch("gridpeers.plant.feeder.plant.Dynamics", DaeDynamics):
        return Plant(network, replace(settings, h=record_step, method="second-order"), T_c, record_step)


def _states(units: Inverters, places: NDArray[np.int64], names: tuple[str, ...]) -> Real:
    return np.array([units.state_of(i)[name] for name in names for i in places.tolist()])


def _those(units: tuple[Inverter, ...], kind: str) -> list[Inverter]:
    return [unit for unit in units if unit.kind == kind]
