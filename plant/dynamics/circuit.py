"""The electrical circuit of the dynamics: one admittance matrix, loads, sources, terminals; and its errors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from gridpeers.plant.dynamics.kernel.compiled import A120, Complex, Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.solve import COLUMNS, limited_currents, limited_tangents


class PlantError(RuntimeError):
    """The plant has no solution; the message says where, and what to try."""


class NoSolutionError(PlantError):
    """Islands, by their numbers in the network's reduction, have no solution with the present injections."""

    def __init__(self, islands: tuple[int, ...]) -> None:
        super().__init__(f"{len(islands)} islands have no solution")
        self.islands = islands


class NoPowerFlowError(PlantError):
    """No operating point at the start; `weak`: load branches too large even alone, and short-circuit powers (VA)."""

    def __init__(self, weak: dict[int, float]) -> None:
        super().__init__("no initial operating point: the power flow has no solution")
        self.weak = weak


PHASES = np.array([1.0, A120.conjugate(), A120])  # balanced set of phasors, phase A at 0
_ONTO_A = np.array([1.0, A120, A120**2])  # factors that turn the phases of a balanced set onto phase A


def aligned_sum(V: Complex) -> Complex:
    """Return the sum of the phasors in the last axis (A, B, C), each turned onto phase A: 3 x positive sequence."""
    return np.asarray(V @ _ONTO_A)


@dataclass(frozen=True, kw_only=True)
class LoadLaw:
    """The law of m load branches, as parallel arrays."""

    S: Complex  # constant power of each (VA)
    I0: Complex  # constant current of each (A) at branch voltage angle 0: I = I0 V / abs(V)
    limited_at: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    """Branches with a `LoadPart`'s law; their S and I0 are 0."""
    law: Real = field(default_factory=lambda: np.zeros((0, len(COLUMNS))))  # their rows of `kernel.solve.COLUMNS`

    def __add__(self, others: LoadLaw) -> LoadLaw:
        return LoadLaw(
            S=np.concatenate([self.S, others.S]),
            I0=np.concatenate([self.I0, others.I0]),
            limited_at=np.concatenate([self.limited_at, others.limited_at + self.S.size]),
            law=np.concatenate([self.law, others.law]),
        )

    def of(self, branches: Integers) -> LoadLaw:
        place = np.full(self.S.size, -1, np.int64)
        place[branches] = np.arange(branches.size)
        at = place[self.limited_at]
        return LoadLaw(S=self.S[branches], I0=self.I0[branches], limited_at=at[at >= 0], law=self.law[at >= 0])

    def currents(self, V: Complex) -> Complex:
        """Return the branches' currents (A) at their voltages (V); a branch without voltage takes none."""
        magnitude = np.abs(V)
        alive = magnitude > 0.0
        divisor = np.where(alive, V, 1.0)
        current = np.conj(self.S / divisor) + self.I0 * divisor / np.where(alive, magnitude, 1.0)
        if self.limited_at.size:
            limited_currents(self.limited_at, self.law, np.concatenate([V.real, V.imag]), current)
        return np.asarray(np.where(alive, current, 0.0), dtype=np.complex128)

    def tangent(self, V: Complex) -> tuple[Complex, Complex]:
        """Return the factors (S) by which the currents follow the voltages V (V), and these conjugate."""
        magnitude = np.abs(V)
        A = self.I0 / (2.0 * magnitude)
        B = -np.conj(self.S) / np.conj(V) ** 2 - self.I0 * V / (2.0 * magnitude * np.conj(V))
        if self.limited_at.size:
            limited_tangents(self.limited_at, self.law, V, A, B)
        return A, B


@dataclass(frozen=True, kw_only=True, eq=False)
class Circuit:
    """A linear network with non-linear load branches, ideal sources and inverter terminals.

    Phasors rotate at nominal speed; volts are line-to-neutral RMS. The voltage of a node counts from its reference:
    earth, or the neutral to which an inverter there returns. With V = M V' of the voltages V to earth, Y and C are M^T
    Y M and M^T C of those to earth: a current into a terminal comes out of its neutral.
    """

    Y: sp.csc_array  # node admittances (S), n x n, without the inverters' filters; rows of merged nodes are empty
    sources: Integers  # nodes held by an ideal source; may be empty
    source_voltage: Complex
    terminals: Integers  # n_inv x 3 nodes, phases A, B, C; of a single-phase inverter its one node three times
    C: sp.csc_array
    """Incidence of the load branches, n x m, real: branch voltages are C^T V; a current I draws C I out of the
    nodes."""
    loads: LoadLaw  # law of the currents that the branches draw
    V_branch: Complex  # nominal phasor of each branch (V): where the first solution starts
    reference: Integers | None = None  # node from which each voltage counts, -1: earth; None: all earth
    neutrals: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    """Nodes of neutral conductors, which count from earth."""

    def __deepcopy__(self, memo: object) -> Circuit:
        """Return itself: it is never written, so copies of a plant share it, and its factorisation."""
        return self

    @cached_property
    def copies(self) -> Flags:
        """Which terminals are copies, n_inv x 3: the second and the third of a single-phase inverter.

        To the models it is one with three equal phases: its copies have the voltage and the current of its own
        terminal, turned by -120 and 120 degrees, and inject nothing into the network.
        """
        copies = np.zeros(self.terminals.shape, bool)
        copies[:, 1:] = (self.terminals[:, 0] == self.terminals[:, 1])[:, None]
        return copies

    @cached_property
    def turn(self) -> Complex:
        """Factors from each terminal's node to the terminal, n_inv x 3: 1, and `PHASES` of a copy."""
        return np.where(self.copies, PHASES, 1.0 + 0.0j)

    @cached_property
    def returns(self) -> Integers:
        """Node to which each inverter returns, -1: earth."""
        none = np.full(self.terminals.shape[0], -1, np.int64)
        return none if self.reference is None else self.reference[self.terminals[:, 0]]

    def to_earth(self, V: Complex) -> Complex:
        """Return the voltages of all nodes to earth (V) from those to their references."""
        return V if self.reference is None else V + np.where(self.reference >= 0, V[self.reference], 0.0)

    @cached_property
    def without_source(self) -> Circuit:
        return replace(self, sources=self.sources[:0], source_voltage=self.source_voltage[:0])

    def components(self) -> tuple[int, Integers]:
        """Return the number of islands, and each node's; a controller joins its inverter's three terminals."""
        incidence = abs(self.C)
        link = abs(self.Y) + incidence @ incidence.T
        n = self.Y.shape[0]
        first = np.repeat(self.terminals[:, :1], 2, axis=1).ravel()
        rest = self.terminals[:, 1:].ravel()
        tie = sp.csc_array((np.ones(first.size), (first, rest)), shape=(n, n))
        s = self.sources if self.reference is None else self.sources[self.reference[self.sources] < 0]
        if s.size > 1:  # the phases of one ideal source, too
            tie = tie + sp.csc_array((np.ones(s.size - 1), (np.repeat(s[:1], s.size - 1), s[1:])), shape=(n, n))
        if (back := self.returns >= 0).any():
            ends = self.terminals[back, 0], self.returns[back]
            tie = tie + sp.csc_array((np.ones(ends[0].size), ends), shape=(n, n))
        count, label = connected_components(link + tie, directed=False)
        return int(count), np.asarray(label, dtype=np.int64)
