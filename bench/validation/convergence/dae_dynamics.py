"""The plant's equations integrated by scipy, with the network solved at every evaluation: the limit of small steps."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bench.validation.convergence.inverter_equations import (
    GFL_STATES,
    GFM_STATES,
    TURN,
    Complex,
    GflEquations,
    GfmEquations,
    Real,
)
from bench.validation.convergence.network_equations import EXACT, NetworkEquations
from plant.dynamics import Circuit, Dynamics, Inverter
from plant.dynamics.kernel.controller_pass import READING
from plant.feeder import Plant
from plant.network import Network
from plant.plant_config import PlantSettings

RELATIVE, ABSOLUTE = 1e-7, 1e-8
"""Tolerances of the integration (pu, rad, Hz)."""


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
        start = np.concatenate([_states(units.gfm_state, GFM_STATES), _states(units.gfl_state, GFL_STATES)])
        rows = self.h * np.arange(1, steps + 1)
        solution = solve_ivp(
            self.slopes, (0.0, rows[-1]), start, "DOP853", rows, rtol=RELATIVE, atol=ABSOLUTE, vectorized=False
        )
        if not solution.success:
            raise RuntimeError(solution.message)
        return np.array([self._read(x) for x in solution.y.T])

    def slopes(self, t: float, x: Real) -> Real:
        """Return the time derivatives of all states."""
        gfm, gfl, _, V = self._algebraic(x)
        P_set, V_set, _ = self.inverters.set_points.T
        former, follower = self.inverters.gfm_at, self.inverters.gfl_at
        return np.concatenate(
            [
                self._gfm.slopes(gfm, P_set[former], V_set[former], V[self._network.formed]).ravel(),
                self._gfl.slopes(gfl, P_set[follower], V_set[follower], V[self._network.fed]).ravel(),
            ]
        )

    def _follow_switching(self) -> None:
        """Take over the present network; its first guess is the plant's own solution."""
        units, circuit = self.inverters, self.network.circuit
        if self._solved is circuit:
            return
        if not self.network.reduction.online.all():
            raise RuntimeError("the reference has no inverter that is off")
        if units.single.any():
            raise RuntimeError("the reference has no single-phase inverter")
        self._gfm, self._gfl = GfmEquations(_those(units.units, "GFM")), GflEquations(_those(units.units, "GFL"))
        terminals = circuit.terminals
        self._network = NetworkEquations(circuit, self._gfm.y_f, terminals[units.gfm_at], terminals[units.gfl_at])
        angle = float(units.gfm_state["theta"][0]) if self._network.rotates else 0.0
        self._V = self.voltages()[self._network.nodes] * np.exp(-1j * angle)
        self._solved = circuit

    def _algebraic(self, x: Real) -> tuple[Real, Real, float, Complex]:
        """Return the states in the frame of the first GFM, its angle (rad), and the nodes' voltages (V) there."""
        units, network = self.inverters, self._network
        split = len(GFM_STATES) * units.gfm_at.size
        gfm = x[:split].reshape(len(GFM_STATES), -1).copy()
        gfl = x[split:].reshape(len(GFL_STATES), -1).copy()
        angle = float(gfm[-1, 0]) if network.rotates else 0.0
        gfm[-1] -= angle
        gfl[1] -= angle
        P_set, V_set, _ = units.set_points[units.gfm_at].T
        E = self._gfm.outputs(gfm, P_set, V_set)[1]
        V = self._V
        weights = np.conj(TURN) * np.exp(-1j * gfl[1])[:, None] / (3.0 * self._gfl.V_b)[:, None]
        for count in range(60):
            currents, by_u = self._gfl.currents(gfl, V[network.fed])
            if count % 8 == 7 or not network.factorised:
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
        gfm, gfl, angle, V = self._algebraic(x)
        P_set, V_set, _ = units.set_points[units.gfm_at].T
        w, E, _ = self._gfm.outputs(gfm, P_set, V_set)
        readings = np.zeros((len(units), READING))
        readings[units.gfm_at, 0] = w
        readings[units.gfl_at, 0] = self._gfl.speed(gfl, V[network.fed])
        readings[:, 0] = units.f_nom + readings[:, 0] / (2.0 * np.pi)
        back = np.exp(1j * angle)
        units.V[units.gfm_at], units.V[units.gfl_at] = V[network.formed] * back, V[network.fed] * back
        units.J[units.gfm_at] = self._gfm.y_f[:, None] * E * back
        units.J[units.gfl_at] = self._gfl.currents(gfl, V[network.fed])[0] * back
        S = np.sum(units.V * np.conj(units.J - units.y_f[:, None] * units.V), axis=1)
        magnitude = np.abs(units.V)
        readings[:, 1], readings[:, 2] = S.real, S.imag
        readings[:, 3], readings[:, 4], readings[:, 5] = magnitude.mean(1), magnitude.min(1), magnitude.max(1)
        gfm[-1] += angle
        gfl[1] += angle
        for states, names, rows in ((units.gfm_state, GFM_STATES, gfm), (units.gfl_state, GFL_STATES, gfl)):
            for name, row in zip(names, rows, strict=True):
                states[name] = row
        units.gfm_state["w"] = w
        self.network.V_branch[network.branches] = network.branch_voltages(V) * back
        return readings


def reference_plant(network: Network, settings: PlantSettings, T_c: float, record_step: float) -> Plant:
    """Return our plant with switches, set-points and readings, but with `DaeDynamics`."""
    with patch("plant.feeder.plant.Dynamics", DaeDynamics):
        return Plant(network, replace(settings, h=record_step, method="second-order"), T_c, record_step)


def _states(records: NDArray[np.void], names: tuple[str, ...]) -> Real:
    return np.concatenate([records[name] for name in names])


def _those(units: tuple[Inverter, ...], kind: str) -> list[Inverter]:
    return [unit for unit in units if unit.kind == kind]
