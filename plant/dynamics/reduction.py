r"""A switch state in the form of the inner loop: by dense matrices, or by sparse admittances with the loads' tangent.

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
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from gridpeers.plant.dynamics.circuit import Circuit, LoadLaw
from gridpeers.plant.dynamics.island_newton import ROUNDING, DenseIsland, solve_island
from gridpeers.plant.dynamics.kept_network import WEAK, BlockPattern, kept_network
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.network_arrays import COPY, Reduced, SparseMaps, factorise_blocks, solve_blocks
from gridpeers.plant.dynamics.switch_state import SwitchState
from gridpeers.plant.dynamics.threads import one_thread


class DenseReduction(SwitchState):
    """A switch state as small dense matrices between load branches and inverter terminals."""

    @one_thread()
    def __init__(self, circuit: Circuit, y_f: Complex, forming: Flags, online: Flags) -> None:
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
        """Return branch voltages (V) by Newton's method, and the islands without solution, which keep the guess."""
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
        return self._b_S @ source_voltage, self._G_S @ source_voltage

    @one_thread()
    def linearise(self, V_b: Complex, source_voltage: Complex, theta: Real) -> Reduced:
        """Return the inner-loop arrays with the loads' tangent at branch voltages (V) and inverters' angles (rad)."""
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


class SparseReduction(SwitchState):
    """A switch state by its sparse admittances; what it offers is what `DenseReduction` offers."""

    def __init__(self, circuit: Circuit, y_f: Complex, forming: Flags, online: Flags) -> None:
        super().__init__(circuit, y_f, forming, online)
        self._kept = kept = kept_network(circuit, self.unknown, self.branches, self.C, self.to_ground)
        self._at, self._whole_at = (
            np.where(circuit.copies, COPY, of[circuit.terminals]) for of in (kept.place, self.place)
        )
        self._feeds = np.zeros(len(circuit.terminals), bool)
        self._feeds[self.feeding % max(self._feeds.size, 1)] = True
        self._filters = np.zeros(kept.nodes.size, complex)
        joined = (self._at >= 0) & self.online[:, None]
        np.add.at(self._filters, self._at[joined], np.broadcast_to(np.asarray(y_f)[:, None], joined.shape)[joined])
        self._Y = (kept.Y + sp.diags_array(self._filters)).tocsc()
        self.node_island = self.label[kept.nodes]
        self._lu: SuperLU | None = None

    def linearise(self, V_b: Complex, source_voltage: Complex, theta: Real) -> Reduced:
        net = self.at_tangent(V_b, theta)
        kept = self._kept
        from_sources = kept.C_S.T @ source_voltage
        drawn = net.i_c + net.A * from_sources + net.B * np.conj(from_sources)
        constant = -(kept.Y_S @ source_voltage) - kept.C @ drawn
        if not constant.size:
            return self._without_unknowns(net, from_sources, source_voltage)
        pattern, matrix = kept.pattern, kept.pattern.matrix(net.A, net.B, self._filters)
        factorise_blocks(matrix)
        return net._replace(
            sparse=SparseMaps(
                factored=matrix,
                constant=_interleaved(constant),
                first=pattern.first,
                second=pattern.second,
                a_first=pattern.a_first,
                a_second=pattern.a_second,
                from_sources=from_sources,
                terminals=self._at,
                fixed=self._held_voltages(source_voltage),
                feeds=self._feeds,
                scratch=np.empty(4 * constant.size),
                increments=np.zeros((4, 2 * V_b.size)),
                rate=np.array([1.0, 1.0 / np.min(np.abs(V_b), initial=np.inf)]),
            )
        )

    def _without_unknowns(self, net: Reduced, from_sources: Complex, source_voltage: Complex) -> Reduced:
        """Return the arrays where nothing is live but what a source holds: the kernel takes the dense ones then."""
        m, n = 2 * from_sources.size, 2 * self.terminals.size
        held = (self.circuit.turn * self._held_voltages(source_voltage)).T.ravel()
        return net._replace(
            PT=np.zeros((n, m)),
            QT=np.zeros((m, m)),
            x_c=np.concatenate([from_sources.real, from_sources.imag]),
            GGT=np.zeros((n, n)),
            GBT=np.zeros((m, n)),
            s_G=np.concatenate([held.real, held.imag]),
        )

    def solve_islands(self, J: Complex, source_voltage: Complex, guess: Complex) -> tuple[Complex, tuple[int, ...]]:
        V_b, failed, C = guess.copy(), [], self._kept.C
        from_sources = self._kept.C_S.T @ source_voltage
        right = self._injected(J, self._at, self._Y.shape[0]) - self._kept.Y_S @ source_voltage
        beginning = self._node_guess(guess, from_sources, right)
        for k in np.flatnonzero(self.live).tolist():
            nodes, own = np.flatnonzero(self.node_island == k), np.flatnonzero(self.branch_island == k)
            island = SparseIsland(
                self._Y[nodes][:, nodes].tocsc(),
                C[nodes][:, own].tocsc(),
                self.loads.of(own),
                from_sources[own],
                right[nodes],
            )
            solution = solve_island(island, beginning[nodes]) if nodes.size else np.zeros(0, complex)
            if solution is None:
                failed.append(k)
            else:
                V_b[own] = C[nodes][:, own].T @ solution + from_sources[own]
        return V_b, tuple(failed)

    def _node_guess(self, V_b: Complex, from_sources: Complex, right: Complex) -> Complex:
        """Return node voltages (V) that go with the loads' currents at these branch voltages (V)."""
        A, _ = self.loads.tangent(V_b)
        C = self._kept.C
        Y = (self._Y + C @ sp.diags_array(A) @ C.T).tocsc()
        constant = right - C @ (self.loads.currents(V_b) - A * V_b + A * from_sources)
        return np.asarray(splu(sp.csc_matrix(Y)).solve(constant))

    def terminal_voltages(self, J: Complex, V_b: Complex, source_voltage: Complex) -> Complex:
        return self.circuit.turn * self.node_voltages(J, V_b, source_voltage)[self.circuit.terminals]

    def all_voltages(self, J: Complex, I_b: Complex, source_voltage: Complex) -> Complex:
        V = np.zeros(self.circuit.Y.shape[0], complex)
        if self.unknown.size:
            if self._lu is None:
                self._lu = splu(sp.csc_matrix(self.Y[self.unknown][:, self.unknown]))
            right = self._injected(J, self._whole_at, self.unknown.size)
            V[self.unknown] = self._lu.solve(right - self._kept.Y_S_whole @ source_voltage - self._kept.C_whole @ I_b)
        V[self.circuit.sources] = source_voltage
        return V

    def _injected(self, J: Complex, at: Integers, size: int) -> Complex:
        right = np.zeros(size, complex)
        feeding = (at >= 0) & self._feeds[:, None]
        np.add.at(right, at[feeding], J[feeding])
        return right

    def _held_voltages(self, source_voltage: Complex) -> Complex:
        V = np.zeros(self.circuit.Y.shape[0], complex)
        V[self.circuit.sources] = source_voltage
        return np.asarray(V[self.circuit.terminals].reshape(-1, 3))


class SparseIsland:
    """An island by its node voltages, F(V) = Y V + C I_b(C^T V + c) - J; `from_sources`: c (V); `right`: J (A)."""

    def __init__(self, Y: sp.csc_array, C: sp.csc_array, loads: LoadLaw, from_sources: Complex, right: Complex) -> None:
        self._Y, self._C, self._loads, self._c, self._right = Y, C, loads, from_sources, right
        self.without_load: Complex = splu(sp.csc_matrix(Y)).solve(right) if right.size else right
        self.V_nom: Real = np.maximum(np.abs(self.without_load), 1.0)
        own, most = np.abs(Y.diagonal()), abs(Y).max(axis=1).toarray().ravel() if right.size else 0.0
        self._scale = np.where(own <= WEAK * most, most, own) * self.V_nom
        self._pattern = BlockPattern(Y, C)

    def residual(self, V: Complex, part: float) -> tuple[Complex, float]:
        drawn = self._loads.currents(self._C.T @ V + self._c)
        F = self._Y @ V + part * (self._C @ drawn) - self._right
        return F, float(np.max(np.abs(F) / self._scale, initial=0.0))

    def step(self, V: Complex, F: Complex, part: float) -> tuple[Complex, bool] | None:
        A, B = self._loads.tangent(self._C.T @ V + self._c)
        matrix = self._pattern.matrix(part * A, part * B)
        # without load the determinant is that of a complex matrix, squared in magnitude: positive
        positive = factorise_blocks(matrix)
        step = _interleaved(-F)
        solve_blocks(matrix, step)
        dV = step.view(complex)
        if not np.isfinite(dV).all():  # it is singular
            return None
        small = float(np.max(np.abs(dV) / self.V_nom, initial=0.0)) <= ROUNDING
        return dV, not small or positive


def _interleaved(V: Complex) -> Real:
    return np.ascontiguousarray(V, complex).view(float)


Reduction = DenseReduction | SparseReduction

MOST_DENSE = 30  # load branches up to which dense matrices are faster: their cost grows with the square of it


def reduce_network(circuit: Circuit, y_f: Complex, forming: Flags, online: Flags) -> Reduction:
    """Return a switch state as it is solved: sparse with many loads, and with a neutral, for small differences."""
    if circuit.two_ended and (circuit.loads.S.size > MOST_DENSE or circuit.neutrals.size):
        return SparseReduction(circuit, y_f, forming, online)
    return DenseReduction(circuit, y_f, forming, online)
