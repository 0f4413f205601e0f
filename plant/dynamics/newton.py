r"""Branch voltages of one island by Newton's method, for where the frozen tangent of the inner loop does not lead.

Solves :math:`F(V) = V - E + Z I_b(V) = 0`, E being the voltages without load, with a fresh tangent each iteration and
steps shortened until F shrinks. Where that fails the load is raised from nothing to all of it (continuation): this
follows the solution of high voltage up to the largest load that has one. So None means that the island has no
solution that it could have come to, not that an iteration gave up.

F has the sign of its Jacobian's determinant on that branch from no load on; the solutions of low voltage, at which no
network can stand, have the other one.
"""

from __future__ import annotations

import numpy as np

from plant.dynamics.blas import one_thread
from plant.dynamics.reduction import Complex, Real, Reduction, tangent

ITERATIONS = 40
"""Of Newton's method; it takes 4 to 10."""
SHORTEST_STEP = 2.0**-10
"""Smallest part of a Newton step, and of the load in the continuation."""
TOLERANCE = 2e-12
"""Largest last step (pu of the branch's nominal voltage): under that of the inner loop, which goes on from here."""
NOISE = 1e-12
"""Residual (pu) below which it need not shrink: it is rounding."""


def solve_islands(
    reduction: Reduction, J: Complex, source_voltage: Complex, guess: Complex
) -> tuple[Complex, tuple[int, ...]]:
    """Voltages of the live branches (V), each island on its own, and the islands that have no solution.

    Parameters
    ----------
    reduction
        The network.
    J
        Injections (A), n_inv x 3, in the common frame.
    source_voltage
        Phasors of the ideal sources (V).
    guess
        Where to begin (V); kept for an island without solution.
    """
    at_branches, at_terminals = reduction.without_load(J, source_voltage)
    V_b, failed = guess.copy(), []
    for k in np.flatnonzero(reduction.live).tolist():
        own = np.flatnonzero(reduction.branch_island == k)
        rows = reduction.branches[own]
        circuit = reduction.circuit
        island = Island(reduction.Z_bb[np.ix_(own, own)], circuit.S[rows], circuit.I0[rows], circuit.V_branch[rows])
        found = island.solve(at_branches[own], guess[own])
        if found is None or not np.isfinite(at_terminals[np.tile(reduction.inverter_island == k, 3)]).all():
            failed.append(k)
        else:
            V_b[own] = found
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
        """Branch voltages (V) for the voltages without load E (V), or None if there are none.

        Parameters
        ----------
        E
            Voltages without load (V).
        guess
            Where to begin (V), e.g. the last voltages.
        """
        if not np.isfinite(E).all():
            return None
        with np.errstate(all="ignore"):  # a trial beyond all bounds is not finite, and is not taken
            found = self._newton(E, guess, 1.0)
            return self._raise_load(E) if found is None else found

    def _raise_load(self, E: Complex) -> Complex | None:
        """Continuation in the load, by steps that are halved where they fail."""
        V, part, step = E, 0.0, 0.25
        while part < 1.0:
            found = self._newton(E, V, min(1.0, part + step))
            if found is None:
                step /= 2.0
                if step < SHORTEST_STEP:
                    return None
            else:
                V, part = found, min(1.0, part + step)
                step *= 2.0
        return V

    def _newton(self, E: Complex, guess: Complex, part: float) -> Complex | None:
        """Solution with this part of the load, on the branch of high voltage; None if none is found."""
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
