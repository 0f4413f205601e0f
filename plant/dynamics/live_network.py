"""The network of a run: the present switch state's reduction, with the load law's tangent where it was last solved."""

from __future__ import annotations

import numpy as np

from plant.dynamics.circuit import Circuit
from plant.dynamics.error import NoSolutionError
from plant.dynamics.inverters import Inverters
from plant.dynamics.kernel.solve import solve_network
from plant.dynamics.newton import solve_islands
from plant.dynamics.reduction import Complex, Real, Reduced, Reduction

TOLERANCE = 1e-11
"""Largest change of a voltage in a network solution's last iteration (pu of the highest nominal)."""

KEPT = 64
"""Factored networks that are kept, 1 MB each: enough for all that is scheduled, bounded in a run of many switchings."""


class LiveNetwork:
    """The network between the inverters, from one switching to the next.

    Parameters
    ----------
    circuit
        The network at the start.
    inverters
        One per row of its terminals. `solve` reads their injections and writes their voltages.

    Attributes
    ----------
    reduction : Reduction
        Of the present circuit and the inverters connected to it.
    net : Reduced
        Its arrays for the inner loop, linearised; there after the first `solve`.
    x : float64[2 m]
        [Re; Im] of the live branches' voltages (V), each in its island's frame: the next solution's first guess.
    V_branch : complex128
        Voltages of all branches (V) when last noted, in the common frame.
    """

    net: Reduced
    x: Real

    def __init__(self, circuit: Circuit, inverters: Inverters) -> None:
        self._inverters = inverters
        self._reductions: dict[tuple[Circuit, bytes], Reduction] = {}
        self._unsourced: dict[Circuit, Circuit] = {}
        self.substation_on = True
        """Whether the ideal sources are connected; `plant.dynamics.switching` disconnects them."""
        self.circuit = circuit
        self.reduction = self.reduced(circuit)
        self.V_branch = circuit.V_branch.astype(complex)
        self.source_voltage = self.reduction.circuit.source_voltage
        """Phasors of the ideal sources that are connected (V)."""

    def reduced(self, circuit: Circuit) -> Reduction:
        """Factor a circuit, once: called ahead of a scheduled event, it takes the work out of the event's step."""
        units = self._inverters
        if not self.substation_on:
            if circuit not in self._unsourced:
                self._unsourced[circuit] = circuit.without_source()
            circuit = self._unsourced[circuit]
        key = circuit, units.connected.tobytes()
        if key not in self._reductions:
            if len(self._reductions) == KEPT:
                del self._reductions[next(iter(self._reductions))]
            self._reductions[key] = Reduction(circuit, units.y_f, units.forming, units.connected)
        return self._reductions[key]

    def change(self, circuit: Circuit) -> None:
        """Take another circuit, or the same with other inverters connected; it is yet to be solved."""
        dead = np.ones(self.V_branch.size, bool)
        dead[self.reduction.branches] = False
        self.V_branch[dead] = 0.0
        self.circuit = circuit
        self.reduction = self.reduced(circuit)
        self.source_voltage = self.reduction.circuit.source_voltage

    def guess(self) -> None:
        """Start the next solution from the last voltages, or from nominal ones where there was hardly any."""
        nominal = self.circuit.V_branch * np.exp(1j * self._island_angle())
        self.V_branch = np.where(np.abs(self.V_branch) > 0.1 * np.abs(nominal), self.V_branch, nominal)

    def solve(self) -> None:
        """Linearise where the present injections lead, by Newton's method with a fresh tangent each time.

        Raises
        ------
        NoSolutionError
            If islands have no solution; the terminal voltages are then as before.
        """
        units, branches = self._inverters, self.reduction.branches
        V_b, theta, V = self.V_branch[branches], units.theta(), units.V.copy()
        still = np.ones(self.reduction.count, complex)
        scale = float(units.V_b.max())
        for attempt in range(4):
            self.net = self.reduction.linearise(V_b, self.source_voltage, theta)
            m = V_b.size
            x = np.concatenate([V_b.real, V_b.imag])
            I_b, work = np.empty(m, complex), np.empty(12 * len(units) + 6 * m)
            status = solve_network(self.net, units.J, still, x, I_b, units.V, TOLERANCE * scale, work)
            if status >= 0:
                V_b = x[:m] + 1j * x[m:]
                break
            V_b = self.circuit.V_branch[branches] * (1.0 - 0.1 * attempt) * np.exp(1j * self._island_angle()[branches])
        else:
            units.V[:] = V
            V_b = self._solve_islands(self.V_branch[branches])
            units.V[:] = self.reduction.terminal_voltages(units.J, V_b, self.source_voltage)
        self._linearise(V_b)
        self.V_branch[branches] = V_b

    def renew(self) -> None:
        """Linearise anew where the present injections lead from the present voltages, in the middle of a step.

        Raises
        ------
        NoSolutionError
            If islands have no solution.
        """
        self._linearise(self._solve_islands(self._branch_voltages()))

    def set_source(self, source_voltage: Complex) -> None:
        """Move the ideal sources to other phasors (V), topology unchanged."""
        self.source_voltage = source_voltage
        self._linearise(self._branch_voltages())

    def note(self) -> None:
        """Note the branch voltages to which the steps since the last solution have led."""
        if self.x.size:
            self.V_branch[self.reduction.branches] = self._branch_voltages()

    def _solve_islands(self, guess: Complex) -> Complex:
        """Voltages of the live branches (V) from a guess, or NoSolutionError."""
        V_b, failed = solve_islands(self.reduction, self._inverters.J, self.source_voltage, guess)
        if failed:
            raise NoSolutionError(failed)
        return V_b

    def _linearise(self, V_b: Complex) -> None:
        self.net = self.reduction.linearise(V_b, self.source_voltage, self._inverters.theta())
        self.x = np.concatenate([V_b.real, V_b.imag])

    def _branch_voltages(self) -> Complex:
        """Present voltages of the live branches (V), back in the common frame."""
        m = self.x.size // 2
        leader = self.reduction.leader
        angle = np.where(leader >= 0, self._inverters.theta()[leader] - self.net.theta_lin, 0.0)
        turned: Complex = (self.x[:m] + 1j * self.x[m:]) * np.exp(1j * angle)[self.reduction.branch_island]
        return turned

    def _island_angle(self) -> Real:
        """Angle (rad) by which each branch's island is turned, 0 where it has a source or no GFM."""
        theta = self._inverters.theta()
        angle = np.array([theta[k] if k >= 0 else 0.0 for k in self.reduction.leader])
        C = self.circuit.C.tocsc()
        first = C.indices[C.indptr[:-1]] if C.shape[1] else np.zeros(0, np.int64)
        return np.asarray(angle[self.reduction.label[first]])
