"""Kirchhoff's current law at every node, by the voltages that the inner loop finds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.kept_network import kept_network
from gridpeers.plant.dynamics.kernel.solve import solve_network
from gridpeers.plant.dynamics.live_network import TOLERANCE


def kirchhoff_residual(dynamics: Dynamics) -> float:
    """Return the largest current (A) that is left at a node of a live island; infinite without a solution.

    The network is solved as a step solves it. The start has a solver of its own, and cannot tell.
    """
    V, J = solved_voltages(dynamics)
    reduction = dynamics.network.reduction
    C, at = reduction.C, reduction.unknown
    I_b = reduction.loads.currents(C.T @ V)
    left = (reduction.Y @ V + C @ I_b - J)[at]
    return float(np.max(np.abs(left), initial=0.0)) if np.isfinite(left).all() else np.inf


def solved_voltages(dynamics: Dynamics) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the voltages (V) of the circuit's nodes and the currents (A) that inverters inject there.

    A step leaves voltages behind that it found before it moved the inverters' phasors for the last time; these go with
    the phasors as they are. Without a solution they are nan.
    """
    network, units = dynamics.network, dynamics.inverters
    net, reduction = network.net, network.reduction
    m, leader = network.x.size // 2, reduction.leader
    turned = np.where(leader >= 0, units.theta()[leader] - net.theta_lin, 0.0) if len(units) else np.zeros(leader.size)
    frame = np.exp(1j * turned)
    x, V_G = network.x.copy(), np.empty((len(units), 3), complex)
    tolerance = TOLERANCE * float(units.V_b.max(initial=1.0))
    status = solve_network(net, units.J, np.conj(frame), x, np.empty(m, complex), V_G, tolerance)
    V_b = (x[:m] + 1j * x[m:]) * frame[reduction.branch_island]
    V = reduction.node_voltages(units.J, V_b, network.source_voltage)
    circuit = reduction.circuit
    kept = kept_network(circuit, reduction.unknown, reduction.branches, reduction.C, reduction.to_ground).nodes
    V[kept] = net.sparse.scratch[: 2 * kept.size].view(complex) * frame[reduction.node_island]
    rest = np.setdiff1d(reduction.unknown, kept)
    V[rest] = 0.0
    if rest.size:
        V[rest] = splu(csc_matrix(reduction.Y[rest][:, rest])).solve(-(reduction.Y[rest] @ V))
    if status < 0:
        V[:] = np.nan
    J = np.zeros(V.size, complex)
    here = (reduction.place[circuit.terminals] >= 0) & reduction.online[:, None] & ~circuit.copies
    np.add.at(J, circuit.terminals[here], units.J[here])
    return V, J
