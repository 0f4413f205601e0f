"""The network between inverters of constant power: a fixed point, started from the loads' nominal voltages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.error import NoPowerFlowError, PlantError
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.kernel.constant_power import NO_NETWORK, settle_powers
from gridpeers.plant.dynamics.reduction.reduce_network import reduce_network
from gridpeers.plant.dynamics.reduction.reduced import Complex, Real, Reduced
from gridpeers.plant.dynamics.weak_branches import weak_branches

MOST_ROUNDS = 500
"""Rounds between the network and inverters of constant power, within which the changes of injections must end or halve:
near the largest power that a network carries a round leaves most of an error."""

NEAR = 4
"""Rounds after which the voltages are near enough to the solution for a tangent that serves to the end."""


class PowerFlow:
    """Fixed point between the network and inverters of constant power."""

    def __init__(self, circuit: Circuit, units: Inverters, held: NDArray[np.bool_]) -> None:
        # GFM filters stay in the network, because their EMF is balanced, not their current; a GFL is a pure current
        y = np.where(units.forming & ~held, units.y_f, 0.0)
        self.reduction = reduce_network(circuit, y, units.forming, units.connected)
        self.circuit, self.units, self.y = circuit, units, y
        self.V_b = circuit.V_branch[self.reduction.branches].astype(complex)
        self.I_b = np.empty(self.V_b.size, complex)
        """Currents of the live load branches (A), of the last solution."""
        self.net = self._linearise()
        self._near = False

    def _linearise(self) -> Reduced:
        theta = np.zeros(len(self.units))
        return self.reduction.linearise(self.V_b, self.circuit.source_voltage, theta)

    def _renew(self, J: Complex) -> None:
        """Move the tangent to where Newton's method leads: across a limit of the loads' law it does not itself."""
        self.V_b, failed = self.reduction.solve_islands(J, self.circuit.source_voltage, self.V_b)
        if failed:
            raise self._no_power_flow()
        self.net = self._linearise()

    def solve(self, J: Complex, P: Real, Q: Real, frozen: NDArray[np.bool_]) -> tuple[Complex, Complex]:
        """Return injections and voltages where every inverter that is not frozen delivers P + jQ (pu)."""
        units, m = self.units, self.V_b.size
        J, V = J.copy(), np.empty(J.shape, complex)
        tolerance, left, renewed = 1e-12 * float(units.V_b.max()), MOST_ROUNDS, False
        total, before = MOST_ROUNDS, 1.0
        while left > 0:
            most = left if self._near else min(left, NEAR)
            x = np.concatenate([self.V_b.real, self.V_b.imag])
            rounds, change = settle_powers(
                most,
                self.net,
                J,
                (P + 1j * Q) * units.S_3,
                self.y,
                units.S_3 / units.V_b,
                ~frozen & self.reduction.online,
                units.balanced,
                x,
                self.I_b,
                V,
                tolerance,
            )
            if rounds == NO_NETWORK:
                if renewed:
                    raise self._no_power_flow()
                renewed = True
                self._renew(J)
                continue
            left, renewed = left - rounds, False
            self.V_b = x[:m] + 1j * x[m:]
            if rounds <= most:
                return J, V
            if not self._near:
                self.net, self._near = self._linearise(), True
            if left <= 0 and change < 0.5 * before:
                left, total, before = MOST_ROUNDS, total + MOST_ROUNDS, change
        raise PlantError(
            f"no initial operating point: injections still change by {change:.1e} pu after {total} iterations; "
            "the inverters may have to deliver more than the network can carry; try another P_set0 or V_set0"
        )

    def _no_power_flow(self) -> NoPowerFlowError:
        reduction, at = self.reduction, self.reduction.unknown
        weak = weak_branches(
            reduction.Y[at][:, at].tocsc(),
            reduction.C.tocsr()[at].tocsc(),
            reduction.loads,
            np.abs(self.circuit.V_branch[reduction.branches]),
        )
        return NoPowerFlowError({int(reduction.branches[k]): S for k, S in weak.items()})
