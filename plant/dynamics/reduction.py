"""A switch state in the form of the inner loop: sparse admittances with the loads' tangent.

With the filters' admittances in Y, the voltages of branches V_b follow from Y V + C I_b(V_b) = J + sources. Splitting
the load law into its tangent at a point V_lin and the remainder, I_b = i_c + A V_b + B V_b^* + N(V_b), each iteration
solves for V with the remainder of the last one. N is of second order in the deviation from V_lin, so the fixed point
converges by about two decades an iteration; the plain current injection gains less than one.

An island without a source rotates away from nominal, but loads do not depend on the angle (I_b rotates with V_b). So
each such island is solved in a frame that rotates with its first GFM, and the tangent stays good for the whole run.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.island_newton import Island, solve_island
from gridpeers.plant.dynamics.kept_network import kept_network
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.network_arrays import COPY, Reduced, SparseMaps, factorise_blocks

FLOATING = 1e-12
"""Admittance to ground, relative to all of a node's, in an island that single-phase inverters alone feed: else phases
without an inverter would have no determined voltage."""

EARTHING = 1e3  # admittance (S) with which a GFM earths the neutral of an island that has lost its earth
UNEARTHED = 0.03 / 50.0  # admittance (S) below which a neutral is not earthed: 50 V over 30 mA (IEC 60364-4-41)
INSULATION = 1e-6  # admittance to earth (S) of all neutrals that nothing earths: their voltages must be determined


class Reduction:
    """A switch state: its islands, and its admittances with the inverters' filters, reduced to the nodes that matter.

    `y_f`: filter admittance of each inverter (S per phase); `online`: the connected ones; the others are open.

    `unknown`: nodes in live islands that have an admittance and that no source holds; `place`: position of each node
    among them, or -1; `earthing`: inverters that earth the neutral of their island, because nothing else does (IEC
    60364-5-551).
    """

    def __init__(self, circuit: Circuit, y_f: Complex, forming: Flags, online: Flags) -> None:
        self.circuit = circuit
        n_inv = circuit.terminals.shape[0]
        n = circuit.Y.shape[0]
        self.count, self.label = circuit.components()
        self.inverter_island = self.label[circuit.terminals[:, 0]] if n_inv else np.zeros(0, np.int64)

        fed = np.zeros(self.count, bool)
        fed[self.label[circuit.sources]] = True
        self.has_source = fed.copy()
        fed[self.inverter_island[forming & online]] = True
        self.live = fed  # whether each island has a source or a GFM
        self.online = online & fed[self.inverter_island]  # inverters that are connected and in a live island
        self.leader = np.full(self.count, -1, np.int64)
        for i in reversed(range(n_inv)):
            if forming[i] and self.online[i] and not self.has_source[self.inverter_island[i]]:
                self.leader[self.inverter_island[i]] = i

        used = np.diff(circuit.Y.indptr) > 0
        used[circuit.terminals[self.online].ravel()] = True  # a lone inverter without load has only its filter
        held = np.zeros(n, bool)
        held[circuit.sources] = True
        self.unknown = np.flatnonzero(fed[self.label] & ~held & used)
        self.place = np.full(n, -1, np.int64)
        self.place[self.unknown] = np.arange(self.unknown.size)

        C = circuit.C.tocsc()
        first = C.indices[C.indptr[:-1]] if C.shape[1] else np.zeros(0, np.int64)
        self.branches = np.flatnonzero(fed[self.label[first]]) if C.shape[1] else first  # branches in live islands
        self.branch_island = self.label[first[self.branches]]
        self.loads = circuit.loads.of(self.branches)  # law of the live branches

        G = circuit.terminals.T.ravel()  # of all A, then all B, then all C
        injects = np.tile(self.online, 3) & ~circuit.copies.T.ravel()
        y_diagonal = np.zeros(n, complex)
        np.add.at(y_diagonal, G, np.where(injects, np.tile(y_f, 3), 0.0))
        whole = np.bincount(self.label[circuit.sources], minlength=self.count) >= 3
        whole[self.inverter_island[forming & self.online & ~circuit.copies[:, 1]]] = True
        self.to_ground = np.zeros(n)  # admittance added at each node (S), so that nothing floats
        if (on_few_phases := fed & ~whole).any():
            self.to_ground = np.where(on_few_phases[self.label], FLOATING * np.abs(circuit.Y.diagonal()), 0.0)
            y_diagonal += self.to_ground
        self.Y = (circuit.Y + sp.diags_array(y_diagonal)).tocsr()
        following = np.flatnonzero(np.tile(~forming & (circuit.returns < 0), 3) & injects)
        no_earth = np.zeros(n, complex)
        np.add.at(no_earth, G[following], np.tile(y_f, 3)[following])
        formers = np.flatnonzero(forming & self.online & (circuit.returns >= 0))
        self.earthing = tuple(self._earthing(formers, sp.csr_array(sp.diags_array(no_earth))))
        self._insulate()
        self.C = C[:, self.branches]
        self._kept = kept = kept_network(circuit, self.unknown, self.branches, self.C, self.to_ground)
        self._at, self._whole_at = (
            np.where(circuit.copies, COPY, of[circuit.terminals]) for of in (kept.place, self.place)
        )
        self._feeds = np.any((self._whole_at >= 0) & self.online[:, None], axis=1)
        self._filters = np.zeros(kept.nodes.size, complex)
        joined = (self._at >= 0) & self.online[:, None]
        np.add.at(self._filters, self._at[joined], np.broadcast_to(np.asarray(y_f)[:, None], joined.shape)[joined])
        self._Y = (kept.Y + sp.diags_array(self._filters)).tocsc()
        self.node_island = self.label[kept.nodes]

    def __deepcopy__(self, memo: object) -> Reduction:
        """Nothing in it is ever written: copies of a plant share it, as they share its circuit."""
        return self

    def _earthing(self, formers: Integers, no_earth: sp.csr_array) -> Iterator[int]:
        """Earth the unearthed neutrals of these inverters in islands without a source; yield the earthing inverters.

        A filter of `no_earth` earths nothing: a GFL injects its current whatever the voltage is.
        """
        circuit = self.circuit
        for i in formers.tolist():
            neutral, island = circuit.returns[i], self.inverter_island[i]
            own = circuit.sources[self.label[circuit.sources] == island]
            if self.place[neutral] < 0 or circuit.reference is None or (circuit.reference[own] < 0).any():
                continue
            earth = sp.csr_array(([EARTHING], ([neutral], [neutral])), shape=self.Y.shape)
            earthed = self.Y - no_earth + earth
            nodes = self.unknown[self.label[self.unknown] == island]
            at = int(np.searchsorted(nodes, neutral))
            unit = np.zeros(nodes.size, complex)
            unit[at] = 1.0
            seen = 1.0 / splu(sp.csc_matrix(earthed[nodes][:, nodes])).solve(unit)[at]
            if abs(seen - EARTHING) < UNEARTHED:
                self.to_ground[neutral] += EARTHING
                self.Y = self.Y + earth
                yield i

    def _insulate(self) -> None:
        """Give the neutrals that nothing earths the admittance of their insulation."""
        neutrals = self.circuit.neutrals[self.place[self.circuit.neutrals] >= 0]
        if not neutrals.size:
            return
        leak = np.zeros(self.place.size)
        leak[neutrals] = INSULATION / neutrals.size
        insulated = (self.Y + sp.diags_array(leak)).tocsr()
        # with these currents a neutral that nothing earths rises to 1 V, an earthed one hardly
        rise = splu(sp.csc_array(insulated[self.unknown][:, self.unknown])).solve(leak[self.unknown].astype(complex))
        floats = neutrals[np.abs(rise[self.place[neutrals]]) > 0.9]
        if floats.size:
            leak[np.setdiff1d(neutrals, floats)] = 0.0
            self.to_ground += leak
            self.Y = (self.Y + sp.diags_array(leak)).tocsr()

    def linearise(self, V_b: Complex, source_voltage: Complex, theta: Real) -> Reduced:
        """Return the inner loop's arrays with the loads' tangent at branch voltages (V) and inverters' angles (rad)."""
        kept, loads = self._kept, self.loads
        A, B = loads.tangent(V_b)
        i_c = loads.currents(V_b) - A * V_b - B * np.conj(V_b)
        from_sources = kept.C_S.T @ source_voltage
        drawn = i_c + A * from_sources + B * np.conj(from_sources)
        constant = -(kept.Y_S @ source_voltage) - kept.C @ drawn
        pattern, matrix = kept.pattern, kept.pattern.matrix(A, B, self._filters)
        factorise_blocks(matrix)
        return Reduced(
            S=loads.S,
            I0=loads.I0,
            limited_at=loads.limited_at,
            law=loads.law,
            i_c=i_c,
            A=A,
            B=B,
            branch_island=self.branch_island,
            inverter_island=self.inverter_island,
            leader=self.leader,
            theta_lin=np.array([theta[k] if k >= 0 else 0.0 for k in self.leader]),
            sparse=SparseMaps(
                factored=matrix,
                constant=np.ascontiguousarray(constant, complex).view(float),
                ends=pattern.ends,
                ratios=pattern.ratios,
                from_sources=from_sources,
                terminals=self._at,
                fixed=self._held_voltages(source_voltage),
                feeds=self._feeds,
                scratch=np.empty(4 * constant.size),
                increments=np.zeros((4, 2 * V_b.size)),
                rate=np.array([1.0, 1.0 / np.min(np.abs(V_b), initial=np.inf)]),
            ),
        )

    def node_voltages(self, J: Complex, V_b: Complex, source_voltage: Complex) -> Complex:
        """Return every node's voltage (V), 0 in dead islands, from injections (A), branch and source voltages (V)."""
        return self.all_voltages(J, self.loads.currents(V_b), source_voltage)

    def solve_islands(self, J: Complex, source_voltage: Complex, guess: Complex) -> tuple[Complex, tuple[int, ...]]:
        """Return branch voltages (V) by Newton's method, and the islands without solution, which keep the guess."""
        from_sources = self._kept.C_S.T @ source_voltage
        right = self._injected(J, self._at, self._Y.shape[0]) - self._kept.Y_S @ source_voltage
        beginning = self._node_guess(guess, from_sources, right)
        V_b, failed = from_sources.copy(), []
        for k, nodes, own, island in self._islands:
            V = solve_island(island, from_sources[own], right[nodes], beginning[nodes])
            if V is None:
                failed.append(k)
                V_b[own] = guess[own]
            else:
                V_b[own] += island.C.T @ V
        return V_b, tuple(failed)

    def weak_branches(self) -> dict[int, float]:
        """Return branches of constant power that are too much even alone, and the short-circuit powers there (VA).

        A power S behind an impedance Z has a solution where V^2 >= 2 (|Z S| + Re(Z S^*)). A load that grows from
        nothing comes to this solution only if V^2 / |S| is at least |Z|, too.
        """
        S, law = self.loads.S.astype(complex), self.loads.law
        S[self.loads.limited_at] = np.where((law[:, 3] == 0.0) & (law[:, 4] == 0.0), law[:, 0] + 1j * law[:, 1], 0.0)
        C = self.C.tocsr()[self.unknown].tocsc()
        weak = {}
        for k in np.flatnonzero((S != 0.0) & (np.diff(C.indptr) > 0)).tolist():
            ends, branch = C[:, [k]].toarray().ravel(), int(self.branches[k])
            try:
                Z = complex(ends @ self._factors.solve(ends.astype(complex)))
            except RuntimeError:  # singular: nothing can be said
                return {}
            size, V_square = abs(Z * S[k]), abs(self.circuit.V_branch[branch]) ** 2
            if not V_square >= max(size, 2.0 * (size + (Z * S[k].conjugate()).real)):
                weak[branch] = V_square / abs(Z)
        return weak

    @cached_property
    def _islands(self) -> list[tuple[int, Integers, Integers, Island]]:
        """Each live island with unknown nodes: its number, its nodes, its branches, and what Newton's method needs."""
        islands = []
        for k in np.unique(self.node_island).tolist():
            nodes, own = np.flatnonzero(self.node_island == k), np.flatnonzero(self.branch_island == k)
            Y, C = self._Y[nodes][:, nodes].tocsc(), self._kept.C[nodes][:, own].tocsc()
            islands.append((k, nodes, own, Island(Y, C, self.loads.of(own))))
        return islands

    def _node_guess(self, V_b: Complex, from_sources: Complex, right: Complex) -> Complex:
        """Return node voltages (V) that go with the loads' currents at these branch voltages (V)."""
        A, _ = self.loads.tangent(V_b)
        C = self._kept.C
        Y = (self._Y + C @ sp.diags_array(A) @ C.T).tocsc()
        constant = right - C @ (self.loads.currents(V_b) - A * V_b + A * from_sources)
        return np.asarray(splu(sp.csc_matrix(Y)).solve(constant))

    def all_voltages(self, J: Complex, I_b: Complex, source_voltage: Complex) -> Complex:
        V = np.zeros(self.circuit.Y.shape[0], complex)
        if self.unknown.size:
            right = self._injected(J, self._whole_at, self.unknown.size)
            V[self.unknown] = self._factors.solve(
                right - self._kept.Y_S_whole @ source_voltage - self._kept.C_whole @ I_b
            )
        V[self.circuit.sources] = source_voltage
        return V

    @cached_property
    def _factors(self) -> SuperLU:
        return splu(sp.csc_matrix(self.Y[self.unknown][:, self.unknown]))

    def _injected(self, J: Complex, at: Integers, size: int) -> Complex:
        right = np.zeros(size, complex)
        feeding = (at >= 0) & self._feeds[:, None]
        np.add.at(right, at[feeding], J[feeding])
        return right

    def _held_voltages(self, source_voltage: Complex) -> Complex:
        V = np.zeros(self.circuit.Y.shape[0], complex)
        V[self.circuit.sources] = source_voltage
        return np.asarray(V[self.circuit.terminals].reshape(-1, 3))
