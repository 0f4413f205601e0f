"""One switch state of a network: its islands, what feeds them, and what of it is unknown."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.network_arrays import Reduced

FLOATING = 1e-12
"""Admittance to ground, relative to all of a node's, in an island that single-phase inverters alone feed: else phases
without an inverter would have no determined voltage."""

EARTHING = 1e3  # admittance (S) with which a GFM earths the neutral of an island that has lost its earth

UNEARTHED = 0.03 / 50.0  # admittance (S) below which a neutral is not earthed: 50 V over 30 mA (IEC 60364-4-41)

INSULATION = 1e-6  # admittance to earth (S) of all neutrals that nothing earths: their voltages must be determined


class SwitchState:
    """The island structure of a circuit, and its admittances with the inverters' filters.

    `y_f`: filter admittance of each inverter (S per phase); `online`: the connected ones; the others are open.

    `unknown`: nodes in live islands, of any admittance, not held by a source; `place`: position of each node among
    them, or -1; `terminals`: nodes of all A, then all B, then all C (3 n_inv); `earthing`: inverters that earth their
    neutral, because nothing else does in an island of theirs (IEC 60364-5-551).
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
        self.held = held
        self.unknown = np.flatnonzero(fed[self.label] & ~held & used)
        self.place = np.full(n, -1, np.int64)
        self.place[self.unknown] = np.arange(self.unknown.size)

        C = circuit.C.tocsc()
        first = C.indices[C.indptr[:-1]] if C.shape[1] else np.zeros(0, np.int64)
        self.branches = np.flatnonzero(fed[self.label[first]]) if C.shape[1] else first  # branches in live islands
        self.branch_island = self.label[first[self.branches]]
        self.loads = circuit.loads.of(self.branches)  # law of the live branches

        self.terminals = G = circuit.terminals.T.ravel()
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
        self.feeding = np.flatnonzero((self.place[G] >= 0) & injects)  # rows of `terminals` where an inverter injects

    def __deepcopy__(self, memo: object) -> SwitchState:
        """Nothing in it is ever written: copies of a plant share it, as they share its circuit."""
        return self

    def _earthing(self, formers: Integers, no_earth: sp.csr_array) -> Iterator[int]:
        """Earth each neutral of these inverters that nothing earths in an island without a source; yield who does.

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

    def at_tangent(self, V_b: Complex, theta: Real) -> Reduced:
        """Return the inner loop's arrays but the network's, at branch voltages (V) and inverters' angles (rad)."""
        A, B = self.loads.tangent(V_b)
        return Reduced(
            S=self.loads.S,
            I0=self.loads.I0,
            limited_at=self.loads.limited_at,
            law=self.loads.law,
            i_c=self.loads.currents(V_b) - A * V_b - B * np.conj(V_b),
            A=A,
            B=B,
            branch_island=self.branch_island,
            inverter_island=self.inverter_island,
            leader=self.leader,
            theta_lin=np.array([theta[k] if k >= 0 else 0.0 for k in self.leader]),
        )

    def node_voltages(self, J: Complex, V_b: Complex, source_voltage: Complex) -> Complex:
        """Return every node's voltage (V), 0 in dead islands, from injections (A), branch and source voltages (V)."""
        return self.all_voltages(J, self.loads.currents(V_b), source_voltage)

    def all_voltages(self, J: Complex, I_b: Complex, source_voltage: Complex) -> Complex:
        raise NotImplementedError
