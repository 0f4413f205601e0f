"""The inverters' differential equations, written again from `inverter-models.md` sections 3 and 4, without the kernel.

Arrays over all GFM or all GFL; states are rows. What depends at once on the network (terminal voltages) is an argument.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from plant.dynamics import Inverter

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

TURN = np.exp(-2j * np.pi / 3.0 * np.arange(3))
"""Phases A, B, C of a balanced set."""

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
    """Return the slope of an integrator that stops at its bounds."""
    return np.where(((x >= high) & (slope > 0.0)) | ((x <= low) & (slope < 0.0)), 0.0, slope)


class GfmEquations(_Kind):
    """Section 3: droop, limiters, voltage controller."""

    @property
    def y_f(self) -> Complex:
        """Filter admittance of a phase (S)."""
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
