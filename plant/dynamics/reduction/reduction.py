r"""A network of few load branches in the form of the inner loop: dense matrices, made once per switch state.

With the filters' admittances in Y, the network seen from the load branches (voltages V_b, currents I_b)
and from the inverter terminals (voltages V_G, injections J) is

.. math::
    V_b = T_{bG} J + s_b - Z_{bb} I_b(V_b), \qquad  V_G = Z_{GG} J + s_G - Z_{Gb} I_b(V_b).

Splitting the load law into its tangent at a point V_lin and the remainder, I_b = i_c + A V_b + B V_b^* + N(V_b), and
solving for V_b gives x = P J + x_c - Q N(x) on real vectors x = [Re V_b; Im V_b]. N is of second order in the
deviation from V_lin, so the fixed point converges by about two decades an iteration; the plain current
injection gains less than one.

An island without a source rotates away from nominal, but loads do not depend on the angle (I_b rotates with V_b). So
each such island is solved in a frame that rotates with its first GFM, and the tangent stays good for the whole run.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.island_newton import DenseIsland, solve_island
from gridpeers.plant.dynamics.reduction.blas import one_thread
from gridpeers.plant.dynamics.reduction.reduced import Complex, Real, Reduced
from gridpeers.plant.dynamics.switch_state import SwitchState


class DenseReduction(SwitchState):
    """A switch state as small dense matrices between load branches and inverter terminals, before any linearisation.

    Parameters
    ----------
    circuit, y_f, forming, online
        As for `SwitchState`.
    """

    @one_thread()
    def __init__(self, circuit: Circuit, y_f: Complex, forming: NDArray[np.bool_], online: NDArray[np.bool_]) -> None:
        super().__init__(circuit, y_f, forming, online)
        unknown, place, G, Y, C, held = self.unknown, self.place, self.terminals, self.Y, self.C, self.held
        C_U = C.tocsr()[unknown].toarray()
        C_S = C.tocsr()[circuit.sources].toarray()
        E_G = np.zeros((unknown.size, G.size))
        E_G[place[G[self.feeding]], self.feeding] = 1.0
        Y_US = Y[unknown][:, circuit.sources].toarray()

        if unknown.size:
            right = np.hstack([E_G, C_U, -Y_US]).astype(complex)
            columns = splu(Y[unknown][:, unknown].tocsc()).solve(right)
        else:
            columns = np.zeros((0, G.size + C_U.shape[1] + C_S.shape[0]), complex)
        Z_G, Z_C, Z_S = np.split(columns, [G.size, G.size + C_U.shape[1]], axis=1)

        seen = np.flatnonzero(place[G] >= 0)
        turn = circuit.turn.T.ravel()
        copies = np.flatnonzero(circuit.copies.T.ravel())

        def at_terminals(of_unknown: Complex) -> Complex:
            rows = np.zeros((G.size, of_unknown.shape[1]), complex)
            rows[seen] = of_unknown[place[G[seen]]]
            rows[copies] *= turn[copies, None]
            return rows

        self._columns = (Z_G, Z_C, Z_S)
        self._T_bG, self.Z_bb, self._b_S = C_U.T @ Z_G, C_U.T @ Z_C, C_U.T @ Z_S + C_S.T
        self._Z_GG, self._Z_Gb, self._G_S = at_terminals(Z_G), at_terminals(Z_C), at_terminals(Z_S)
        for row, node in enumerate(G):
            if held[node]:
                self._G_S[row, np.flatnonzero(circuit.sources == node)[0]] = turn[row]

    def solve_islands(self, J: Complex, source_voltage: Complex, guess: Complex) -> tuple[Complex, tuple[int, ...]]:
        """Return branch voltages (V) by Newton's method, and the islands that have no solution, which keep the guess.

        Parameters
        ----------
        J
            Injections (A), n_inv x 3, in the common frame.
        source_voltage
            Phasors of the ideal sources (V).
        guess
            Where to begin (V, live branches).
        """
        at_branches, at_terminals = self.without_load(J, source_voltage)
        V_b, failed = guess.copy(), []
        for k in np.flatnonzero(self.live).tolist():
            own = np.flatnonzero(self.branch_island == k)
            rows = self.branches[own]
            loads, nominal = self.circuit.loads.of(rows), self.circuit.V_branch[rows]
            island = DenseIsland(self.Z_bb[np.ix_(own, own)], loads, nominal, at_branches[own])
            solution = solve_island(island, guess[own])
            if solution is None or not np.isfinite(at_terminals[np.tile(self.inverter_island == k, 3)]).all():
                failed.append(k)
            else:
                V_b[own] = solution
        return V_b, tuple(failed)

    def without_load(self, J: Complex, source_voltage: Complex) -> tuple[Complex, Complex]:
        """Return voltages (V) of branches and terminals from injections J (n_inv x 3, A) and sources (V), no load."""
        s_b, s_G = self.source_parts(source_voltage)
        return self._T_bG @ J.T.ravel() + s_b, self._Z_GG @ J.T.ravel() + s_G

    def terminal_voltages(self, J: Complex, V_b: Complex, source_voltage: Complex) -> Complex:
        """Return the terminal voltages (V), n_inv x 3, from injections J (A), branch and source voltages (V)."""
        V_G: Complex = self.without_load(J, source_voltage)[1] - self._Z_Gb @ self.loads.currents(V_b)
        return V_G.reshape(3, -1).T

    def source_parts(self, source_voltage: Complex) -> tuple[Complex, Complex]:
        """Return the voltages (V) that the ideal sources alone give at the branches and at the terminals."""
        return self._b_S @ source_voltage, self._G_S @ source_voltage

    @one_thread()
    def linearise(self, V_b: Complex, source_voltage: Complex, theta: Real) -> Reduced:
        """Return the inner-loop arrays with the load law's tangent at branch voltages `V_b` (V, live branches).

        Parameters
        ----------
        V_b
            Point of linearisation.
        source_voltage
            Phasors of the ideal sources (V).
        theta
            Angle of every inverter at that point (rad).
        """
        net = self.at_tangent(V_b, theta)
        s_b, s_G = self.source_parts(source_voltage)
        m = V_b.size
        M = np.eye(2 * m) + _linear(self.Z_bb * net.A) + _conjugate_linear(self.Z_bb * net.B)
        M_inverse = np.linalg.inv(M)
        return net._replace(
            PT=np.ascontiguousarray((M_inverse @ _linear(self._T_bG)).T),
            QT=np.ascontiguousarray((M_inverse @ _linear(self.Z_bb)).T),
            x_c=M_inverse @ _stack(s_b - self.Z_bb @ net.i_c),
            GGT=np.ascontiguousarray(_linear(self._Z_GG).T),
            GBT=np.ascontiguousarray(_linear(self._Z_Gb).T),
            s_G=_stack(s_G),
        )

    @one_thread()
    def all_voltages(self, J: Complex, I_b: Complex, source_voltage: Complex) -> Complex:
        """Return every node's voltage (V), 0 in dead islands, for injections J (n_inv x 3, A) and currents I_b (A)."""
        V = np.zeros(self.circuit.Y.shape[0], complex)
        Z_G, Z_C, Z_S = self._columns
        V[self.unknown] = Z_G @ J.T.ravel() - Z_C @ I_b + Z_S @ source_voltage
        V[self.circuit.sources] = source_voltage
        return V


def _linear(M: Complex) -> Real:
    """Return the real form of V -> M V on [Re; Im]."""
    return np.block([[M.real, -M.imag], [M.imag, M.real]])


def _conjugate_linear(M: Complex) -> Real:
    """Return the real form of V -> M V^* on [Re; Im]."""
    return np.block([[M.real, M.imag], [M.imag, -M.real]])


def _stack(V: Complex) -> Real:
    return np.concatenate([V.real, V.imag])
