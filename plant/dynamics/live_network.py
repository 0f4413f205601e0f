"""The network of a run: the present switch state, reduced, with the tangent of the loads at its last solution."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from gridpeers.plant.dynamics.circuit import PHASES, Circuit, NoSolutionError
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.island_parts import IslandParts, is_large
from gridpeers.plant.dynamics.kernel.compiled import Complex, Real
from gridpeers.plant.dynamics.kernel.controller_pass import Units
from gridpeers.plant.dynamics.kernel.network_arrays import Reduced
from gridpeers.plant.dynamics.kernel.solve import solve_network
from gridpeers.plant.dynamics.kernel.step import MAX_LIMITING, limit_currents
from gridpeers.plant.dynamics.reduction import Reduction

KEPT = 32  # circuits, and their factors, that are kept: a factored network of 123 nodes has 1 MB
TOLERANCE = 1e-11  # of a network solution: last change of a voltage (pu of the highest nominal one)
WORTH = 40  # iterations of a network solution that cost as much time as new sparse factors


class LiveNetwork:
    """The network between the inverters, from one switching to the next.

    `reduction`: reduction of the present circuit and its connected inverters; `net`: its arrays for the inner loop,
    linearised; `x`: [Re; Im] of the live branches' voltages (V) in their islands' frames, the next solution's first
    guess.
    """

    net: Reduced

    def __init__(self, circuit: Circuit, inverters: Inverters) -> None:
        self._inverters = inverters
        y_f, forming = inverters.y_f, inverters.forming  # copies of a plant share what follows, which has no state
        self._reduction_of = lru_cache(KEPT)(
            lambda circuit, connected: Reduction(circuit, y_f, forming, np.array(connected, bool))
        )
        self.x: Real = np.zeros(0)
        self.substation_on = True  # whether the ideal sources are connected
        self.circuit = circuit
        self.reduction = self.reduced(circuit)
        self._noted: Complex = circuit.V_branch.astype(complex)
        self._excess = 0
        self._parts: IslandParts | None = None

    @property
    def source_voltage(self) -> Complex:
        return self.reduction.circuit.source_voltage

    def reduced(self, circuit: Circuit) -> Reduction:
        """Factor a circuit, once; called ahead of a scheduled event it saves this work in its step."""
        if not self.substation_on:
            circuit = circuit.without_source
        return self._reduction_of(circuit, tuple(self._inverters.connected.tolist()))

    def change(self, circuit: Circuit) -> None:
        """Take another circuit, or the same with other connected inverters; call `solve` next."""
        dead = np.ones(self.V_branch.size, bool)
        dead[self.reduction.branches] = False
        self.V_branch[dead] = 0.0
        self.x = np.zeros(0)
        self.circuit = circuit
        self.reduction = self.reduced(circuit)

    def guess(self) -> None:
        """Start the next solution from the last voltages.

        Where these were almost 0 it starts from nominal ones, at the angle of the first GFM of the island.
        """
        theta = self._inverters.theta() - np.angle(PHASES)[self._inverters.phase]
        angle = np.array([theta[k] if k >= 0 else 0.0 for k in self.reduction.leader])
        C = self.circuit.C.tocsc()
        first = C.indices[C.indptr[:-1]] if C.shape[1] else np.zeros(0, np.int64)
        nominal = self.circuit.V_branch * np.exp(1j * angle[self.reduction.label[first]])
        self.V_branch = np.where(np.abs(self.V_branch) > 0.1 * np.abs(nominal), self.V_branch, nominal)

    def solve(self) -> None:
        """Linearise at the solution of the present injections; NoSolutionError leaves the voltages as before."""
        units, branches = self._inverters, self.reduction.branches
        V_b, theta, V = self.V_branch[branches], units.theta(), units.V.copy()
        still = np.ones(self.reduction.count, complex)
        scale = float(units.V_b.max())
        self.net = self.reduction.linearise(V_b, self.source_voltage, theta)
        m = V_b.size
        x, I_b = np.concatenate([V_b.real, V_b.imag]), np.empty(m, complex)
        if solve_network(self.net, units.J, still, x, I_b, units.V, TOLERANCE * scale) >= 0:
            V_b = x[:m] + 1j * x[m:]
        else:
            units.V[:] = V
            V_b = self._solve_islands(self.V_branch[branches])
            of_nodes = self.reduction.node_voltages(units.J, V_b, self.source_voltage)
            units.V[:] = self.circuit.turn * of_nodes[self.circuit.terminals]
        self._linearise(V_b)

    def renew(self) -> None:
        """Linearise again at the solution of the present injections; NoSolutionError if there is none."""
        self._linearise(self._solve_islands(self._branch_voltages()))

    def refresh(self, iterations: int, solutions: int) -> None:
        """Linearise again once their tangent has cost more iterations than a new one costs time."""
        self._excess += max(iterations - 2 * solutions, 0)
        if self._excess > WORTH:
            self._linearise(self._branch_voltages())

    def parts(self, units: Units) -> IslandParts | None:
        """Return the islands in parts; None where the network is too small, or all is one island."""
        if self._parts is None and is_large(self.net):
            self._parts = IslandParts(self.net, self.reduction.node_island, units)
        return self._parts

    def join_parts(self) -> None:
        """Go on with all islands at once, because a part has failed."""
        self._parts = None
        self.net.sparse.increments[:] = 0.0

    @property
    def V_branch(self) -> Complex:
        """Voltages of all branches (V) in the common frame; may be written between `change` and `solve`."""
        if self.x.size:
            self._noted[self.reduction.branches] = self._branch_voltages()
        return self._noted

    @V_branch.setter
    def V_branch(self, V: Complex) -> None:
        self._noted = V

    def _solve_islands(self, guess: Complex) -> Complex:
        V_b, failed = self.reduction.solve_islands(self._inverters.J, self.source_voltage, guess)
        if failed:
            raise NoSolutionError(failed)
        return V_b

    def _linearise(self, V_b: Complex) -> None:
        self.net = self.reduction.linearise(V_b, self.source_voltage, self._inverters.theta())
        self.x = np.concatenate([V_b.real, V_b.imag])
        self._excess = 0
        self._parts = None

    def _branch_voltages(self) -> Complex:
        m = self.x.size // 2
        leader = self.reduction.leader
        angle = np.where(leader >= 0, self._inverters.theta()[leader] - self.net.theta_lin, 0.0)
        turned: Complex = (self.x[:m] + 1j * self.x[m:]) * np.exp(1j * angle)[self.reduction.branch_island]
        return turned


def unsettled_island(net: Reduced, units: Units, x: Real, tolerance: float) -> int:
    """Return the island whose voltages still change most after as many iterations as the inner loop takes.

    A solution within the current limits began at `units` and `x`, and failed. `net`: linearised at the present angles.
    """
    x, J, V, limiting = x.copy(), units.J.copy(), units.V.copy(), units.limiting.copy()
    I_b = np.empty(x.size // 2, complex)
    still = np.ones(net.leader.size, complex)
    with np.errstate(all="ignore"):  # what diverges is not finite in the end
        for _ in range(MAX_LIMITING):
            surplus = limit_currents(units, J, V, limiting)
            before = x.copy(), V.copy()
            status = solve_network(net, J, still, x, I_b, V, tolerance)
            if status < 0 or surplus <= tolerance:
                break
        if status < 0:  # the last iterations alone tell who diverges: those that have settled do not move again
            before = x.copy(), V.copy()
            solve_network(net, J, still, x, I_b, V, tolerance)
        change = np.zeros(net.leader.size)
        np.maximum.at(change, np.tile(net.branch_island, 2), _size(x - before[0]))
        np.maximum.at(change, net.inverter_island[units.online], _size(V - before[1]).max(axis=1)[units.online])
    return int(np.argmax(change))


def _size(change: Complex | Real) -> Real:
    return np.nan_to_num(np.abs(change), nan=np.inf)
