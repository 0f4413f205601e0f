r"""Branch voltages of one island by Newton's method, where the inner loop's frozen tangent leads to no solution.

The module solves :math:`F(V) = V - E + Z I_b(V) = 0`, E being the voltages without load, with a fresh tangent each
iteration and steps shortened until F shrinks. Where that fails, it raises the load from nothing to all of it
(continuation): this follows the solution of high voltage up to the largest load that has one. So None means that the
island has no solution that it could reach, not that an iteration gave up.

The determinant of F's Jacobian keeps its sign on that branch from no load on; the solutions of low voltage, at which no
network can operate, have the other sign.
"""

from __future__ import annotations

import numpy as np

from plant.dynamics.blas import one_thread
from plant.dynamics.reduction import Complex, Real, Reduction, tangent

ITERATIONS = 40
"""Most iterations of Newton's method; it takes 4 to 10."""
SHORTEST_STEP = 2.0**-10
"""Smallest part of a Newton step, and of the load in the continuation."""
TOLERANCE = 2e-12
"""Largest last step (pu of the branch's nominal voltage): below that of the inner loop, which continues from here."""
NOISE = 1e-12
"""Residual (pu) that counts as rounding: below it the residual need not shrink."""


def solve_islands(
    reduction: Reduction, J: Complex, source_voltage: Complex, guess: Complex
) -> tuple[Complex, tuple[int, ...]]:
    """Return the voltages of the live branches (V), each island on its own, and the islands without solution.

    Parameters
    ----------
    reduction
        The network.
    J
        Injections (A), n_inv x 3, in the common frame.
    source_voltage
        Phasors of the ideal sources (V).
    guess
        Initial guess (V); kept for an island without solution.
    """
    at_branches, at_terminals = reduction.without_load(J, source_voltage)
    V_b, failed = guess.copy(), []
    for k in np.flatnonzero(reduction.live).tolist():
        own = np.flatnonzero(reduction.branch_island == k)
        rows = reduction.branches[own]
        circuit = reduction.circuit
        island = Island(reduction.Z_bb[np.ix_(own, own)], circuit.S[rows], circuit.I0[rows], circuit.V_branch[rows])
        solution = island.solve(at_branches[own], guess[own])
        if solution is None or not np.isfinite(at_terminals[np.tile(reduction.inverter_island == k, 3)]).all():
            failed.append(k)
        else:
            V_b[own] = solution
    return V_b, tuple(failed)


class Island:
    """The load branches of one island.

    Parameters
    ----------
    Z
        Impedance between its branches (ohm), with the inverters' filters.
    S, I0
        Constant power (VA) and constant current (A) of each.
    nominal
        Nominal phasor of each (V).
    """

    def __init__(self, Z: Complex, S: Complex, I0: Complex, nominal: Complex) -> None:
        self._Z, self._S, self._I0, self._V_nom = Z, S, I0, np.abs(nominal)

    @one_thread()
    def solve(self, E: Complex, guess: Complex) -> Complex | None:
        """Return the branch voltages (V) for the voltages without load E (V); None if there is no solution.

        Parameters
        ----------
        E
            Voltages without load (V).
        guess
            Initial guess (V), e.g. the last voltages.
        """
        if not np.isfinite(E).all():
            return None
        with np.errstate(all="ignore"):  # a trial beyond all bounds is not finite, and is rejected
            solution = self._newton(E, guess, 1.0)
            return self._raise_load(E) if solution is None else solution

    def _raise_load(self, E: Complex) -> Complex | None:
        """Raise the load by continuation; halve a step that fails."""
        V, part, step = E, 0.0, 0.25
        while part < 1.0:
            solution = self._newton(E, V, min(1.0, part + step))
            if solution is None:
                step /= 2.0
                if step < SHORTEST_STEP:
                    return None
            else:
                V, part = solution, min(1.0, part + step)
                step *= 2.0
        return V

    def _newton(self, E: Complex, guess: Complex, part: float) -> Complex | None:
        """Return the solution with this part of the load, on the branch of high voltage; None if it finds none."""
        V = guess
        F, size = self._residual(E, V, part)
        for _ in range(ITERATIONS):
            if not np.isfinite(size):
                return None
            jacobian = self._jacobian(V, part)
            try:
                step = np.linalg.solve(jacobian, -np.concatenate([F.real, F.imag]))
            except np.linalg.LinAlgError:
                return None
            dV = step[: V.size] + 1j * step[V.size :]
            if float(np.max(np.abs(dV) / self._V_nom, initial=0.0)) <= TOLERANCE:
                return V + dV if np.linalg.slogdet(jacobian)[0] > 0 else None
            length = 1.0
            F_next, size_next = self._residual(E, V + dV, part)
            while not size_next < (1.0 - 1e-4 * length) * size and size > NOISE:
                length /= 2.0
                if length < SHORTEST_STEP:
                    return None
                F_next, size_next = self._residual(E, V + length * dV, part)
            V, F, size = V + length * dV, F_next, size_next
        return None

    def _residual(self, E: Complex, V: Complex, part: float) -> tuple[Complex, float]:
        F = V - E + part * (self._Z @ (np.conj(self._S / V) + self._I0 * V / np.abs(V)))
        return F, float(np.max(np.abs(F) / self._V_nom, initial=0.0))

    def _jacobian(self, V: Complex, part: float) -> Real:
        A, B = tangent(self._S, self._I0, V)
        ZA, ZB = part * self._Z * A, part * self._Z * B
        real: Real = np.block([[(ZA + ZB).real, (ZB - ZA).imag], [(ZA + ZB).imag, (ZA - ZB).real]])
        return np.eye(2 * V.size) + real
