"""Voltages of one island by Newton's method, for where the frozen tangent of the inner loop does not lead.

A fresh tangent is taken each iteration, and steps are shortened until the residual shrinks. Where that fails the load
is raised from nothing to all of it, which follows the solution of high voltage: there the Jacobian's determinant keeps
the sign that it has without load, and at solutions of low voltage it has the other. So None means: no solution exists.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.kept_network import WEAK, BlockPattern
from gridpeers.plant.dynamics.kernel.compiled import Complex, Real
from gridpeers.plant.dynamics.kernel.network_arrays import factorise_blocks, solve_blocks

ITERATIONS = 40  # of Newton's method; it takes 4 to 10
SHORTEST_STEP = 2.0**-10  # smallest part of a Newton step, and of the load in the continuation
TOLERANCE = 2e-12  # largest last step (pu of nominal voltage): under that of the inner loop, which goes on from here
ROUNDING, STALL = 1e-8, 4
"""Largest step (pu) that may be rounding, and how many such steps in a row that do not halve end the search."""
NOISE = 1e-12  # residual (pu) below which it need not shrink: it is rounding


class Island:
    """The admittances (S) between an island's nodes, and its load branches, prepared for Newton's method."""

    def __init__(self, Y: sp.csc_array, C: sp.csc_array, loads: LoadLaw) -> None:
        self.Y, self.C, self.loads = Y, C, loads
        self.factors = splu(sp.csc_matrix(Y))
        own, most = np.abs(Y.diagonal()), abs(Y).max(axis=1).toarray().ravel()
        self.scale = np.where(own <= WEAK * most, most, own)  # admittances (S) by which residuals are judged
        self.pattern = BlockPattern(Y, C)


class _Equations:
    """F(V) = Y V + C I_b(C^T V + c) - J of an island; `from_sources`: c (V); `right`: J (A)."""

    def __init__(self, island: Island, from_sources: Complex, right: Complex) -> None:
        self._island, self._c, self._right = island, from_sources, right
        self.without_load: Complex = island.factors.solve(right)
        self.V_nom: Real = np.maximum(np.abs(self.without_load), 1.0)
        self._scale = island.scale * self.V_nom

    def residual(self, V: Complex, part: float) -> tuple[Complex, float]:
        """Return F (A) and its size (pu of what the nodes' admittances draw) with this part of the load."""
        it = self._island
        F = it.Y @ V + part * (it.C @ it.loads.currents(it.C.T @ V + self._c)) - self._right
        return F, float(np.max(np.abs(F) / self._scale, initial=0.0))

    def step(self, V: Complex, F: Complex, part: float) -> tuple[Complex, bool] | None:
        """Return Newton's step (V), and whether V is on the branch of high voltage; None if there is none."""
        A, B = self._island.loads.tangent(self._island.C.T @ V + self._c)
        matrix = self._island.pattern.matrix(part * A, part * B)
        # without load the determinant is that of a complex matrix, squared in magnitude: positive
        positive = factorise_blocks(matrix)
        step = (-F).view(float)
        solve_blocks(matrix, step)
        dV = step.view(complex)
        if not np.isfinite(dV).all():  # it is singular
            return None
        small = float(np.max(np.abs(dV) / self.V_nom, initial=0.0)) <= ROUNDING
        return dV, not small or positive


def solve_island(island: Island, from_sources: Complex, right: Complex, guess: Complex) -> Complex | None:
    """Return the voltages (V) of an island, from a guess (V); None if there are none.

    `from_sources`: what ideal sources contribute to the branches' voltages (V); `right`: currents into the nodes (A).
    """
    equations = _Equations(island, from_sources, right)
    if not np.isfinite(equations.without_load).all():
        return None
    with np.errstate(all="ignore"):  # a trial beyond all bounds is not finite, and is not taken
        solution = _newton(equations, guess, 1.0)
        return _raise_load(equations) if solution is None else solution


def _raise_load(equations: _Equations) -> Complex | None:
    V, part, step = equations.without_load, 0.0, 0.25
    while part < 1.0:
        solution = _newton(equations, V, min(1.0, part + step))
        if solution is None:
            step /= 2.0
            if step < SHORTEST_STEP:
                return None
        else:
            V, part = solution, min(1.0, part + step)
            step *= 2.0
    return V


def _newton(equations: _Equations, guess: Complex, part: float) -> Complex | None:
    """Return the solution with this part of the load, on the branch of high voltage; None if none is found."""
    V, former, stalled = guess, np.inf, 0
    F, size = equations.residual(V, part)
    for _ in range(ITERATIONS):
        if not np.isfinite(size):
            return None
        taken = equations.step(V, F, part)
        if taken is None:
            return None
        dV, high = taken
        largest = float(np.max(np.abs(dV) / equations.V_nom, initial=0.0))
        stalled = stalled + 1 if size <= NOISE and 0.5 * former <= largest <= ROUNDING else 0
        if largest <= TOLERANCE or stalled == STALL:
            return V + dV if high else None
        former = largest
        length = 1.0
        F_next, size_next = equations.residual(V + dV, part)
        while not size_next < (1.0 - 1e-4 * length) * size and size > NOISE:
            length /= 2.0
            if length < SHORTEST_STEP:
                return None
            F_next, size_next = equations.residual(V + length * dV, part)
        V, F, size = V + length * dV, F_next, size_next
    return None
