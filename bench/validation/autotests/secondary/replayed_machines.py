"""Our plant's dynamics with machines beside the inverters, whose injections are replayed in each network solution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from plant.dynamics import Circuit, Dynamics, Inverter
from plant.dynamics.kernel.controller_pass import READING, advance_inverters, keep_start, turn_frames
from plant.dynamics.kernel.current_limit import solve_within_limits
from plant.dynamics.live_network import TOLERANCE


class ReplayedMachines(Dynamics):
    """Dynamics that a caller takes from one network solution to the next.

    A machine is an inverter without a controller: whatever its injection is when the network is solved, it stays.

    Parameters
    ----------
    circuit
        The network; the machines' admittances are part of it.
    inverters
        The inverters, then the machines as grid-following current sources.
    machines
        How many machines there are.
    h
        Step (s).
    """

    def __init__(self, circuit: Circuit, inverters: tuple[Inverter, ...], machines: int, h: float) -> None:
        super().__init__(circuit, inverters, h)
        self._machines = machines

    def release(self) -> None:
        """Take out the machines' controllers, which only `start` needs."""
        units = self.inverters
        kept = units.gfl_at < len(units) - self._machines
        units.gfl_at, units.gfl, units.gfl_state = units.gfl_at[kept], units.gfl[kept], units.gfl_state[kept]
        self._gfl_0, self._gfl_d = units.gfl_state.copy(), units.gfl_state.copy()

    def solve(self, J: NDArray[np.complex128], *, second: bool) -> NDArray[np.float64]:
        """Solve the network with the machines' injections J (A, machines x 3), and pass the inverters' controllers.

        Returns
        -------
        float64[n, READING]
            As `Dynamics.run`, of this solution; 0 for the machines.
        """
        units, network, net = self.inverters, self.network, self.network.net
        arrays = self.arrays()
        n, m = len(units), net.S.size
        if not second:
            keep_start(arrays)
        units.J[n - self._machines :] = J
        rotation = np.empty(net.leader.size, complex)
        turn_frames(arrays, net, np.zeros(n), rotation)
        scale, work = float(units.V_b.max()), np.empty(12 * n + 6 * m)
        I_b = np.empty(m, complex)
        if solve_within_limits(net, arrays, rotation, network.x, I_b, TOLERANCE * scale, work) < 0:
            raise RuntimeError("the network has no solution with the replayed machines")
        out = np.zeros((n, READING))
        advance_inverters(arrays, self.h, second, out)
        return out
