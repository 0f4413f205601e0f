"""Inverters on a circuit, advanced in time: the state arrays around the compiled inner loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from plant.dynamics import switching
from plant.dynamics.circuit import Circuit
from plant.dynamics.error import PlantError
from plant.dynamics.initial import OperatingPoint, equilibrium, stand_at
from plant.dynamics.inverters import Inverter, Inverters
from plant.dynamics.kernel.step import READING, run_steps
from plant.dynamics.live import TOLERANCE, LiveNetwork
from plant.dynamics.phasors import PHASES
from plant.dynamics.reduction import Complex, Real


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

    Attributes
    ----------
    inverters : Inverters
        Their state; set-points may be written between runs.
    network : LiveNetwork
        What is between them.

    Notes
    -----
    Call `start` once; then `run` and, at switching, `connect` or `switch_inverter`.
    """

    def __init__(
        self, circuit: Circuit, inverters: tuple[Inverter, ...], h: float, connected: Sequence[bool] | None = None
    ) -> None:
        self.h = h
        self.inverters = Inverters(inverters, connected)
        self.network = LiveNetwork(circuit, self.inverters)

    def start(
        self, P: Real, Q: Real | None = None, V_set: Real | None = None, *, swing_voltage: Complex = PHASES
    ) -> OperatingPoint:
        """Start from the equilibrium at real powers `P` (pu), and at reactive powers `Q` or set-points `V_set` (pu).

        With `Q` the droops are shifted so that they give it, as GridLAB-D does: V_set := v + m_q q for a
        GFM; V_set := v, Q_set := q for a GFL. With `V_set`, Q_set is 0 and q follows from the droop.

        Raises
        ------
        PlantError
            If there is no such equilibrium.
        """
        units, network = self.inverters, self.network
        first = np.zeros(P.size) if Q is None else Q
        point = equilibrium(network.circuit, units, P, first, V_set, swing_voltage=swing_voltage)
        stand_at(units, point, network.reduction.online, P, V_set)
        network.V_branch[network.reduction.branches] = point.V_branch
        self.connect(network.circuit)
        return point

    def connect(self, circuit: Circuit) -> None:
        """Go on with another network; see `plant.dynamics.switching.connect`."""
        switching.connect(self.inverters, self.network, circuit)

    def switch_inverter(self, i: int, on: bool) -> None:
        """Connect an inverter or take it off; see `plant.dynamics.switching.switch_inverter`."""
        switching.switch_inverter(self.inverters, self.network, i, on)

    def run(self, steps: int) -> Real:
        """Advance by `steps` steps; returns steps x n_inv x (f in Hz, P in W, Q in var, V in V).

        With 0 steps the inner loop is only compiled or loaded.

        Raises
        ------
        PlantError
            If a network solution does not converge or a voltage is not finite.
        """
        units, network = self.inverters, self.network
        out = np.zeros((steps, len(units), READING))
        status = run_steps(
            steps,
            self.h,
            TOLERANCE * float(units.V_b.max(initial=1.0)),
            network.net,
            units.gfm,
            units.gfm_at,
            units.gfm_state,
            units.gfl,
            units.gfl_at,
            units.gfl_state,
            network.reduction.online,
            units.set_points,
            units.J,
            units.V,
            units.I,
            network.x,
            out,
        )
        if status < 0 or not np.isfinite(out[-1:]).all():
            where = f" in step {-1 - status} of {steps}" if status < 0 else ""
            raise PlantError(
                f"the network solution did not converge{where} (lowest terminal voltage "
                f"{np.nanmin(np.abs(units.V) / units.V_b[:, None]):.2f} pu): the load may be more than the inverters "
                "can feed, or the controllers unstable; try a smaller h, other gains, or less load"
            )
        network.note()
        return out

    def readings(self) -> Real:
        """Present f (Hz), P (W), Q (var), V (V) from the last solution, n_inv x 4, before any step was taken."""
        return self.inverters.readings(self.network.reduction.online)
