"""A plain power flow of the nodes that the substation feeds: for tests, documentation and starting values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import factorized

from gridpeers.plant.dynamics.island_newton import weak_branches
from gridpeers.plant.dynamics.kernel.compiled import Complex, Integers
from gridpeers.plant.network.loads import LoadBranches
from gridpeers.plant.network.network import Network

Injection = Callable[[Complex], Complex]
"""Function from the voltages of all nodes (V) to the currents fed into them (A)."""

MOST_ITERATIONS = 200
"""Most iterations: a feeder that can carry its loads takes about 10, one that cannot diverges long before."""

NOISE = 1e-8  # change (pu) that may be rounding in any network; more where a section has next to nothing to ground
STALL = 8  # iterations without a smaller change after which it is rounding


@dataclass(frozen=True, kw_only=True)
class PowerFlow:
    V: Complex  # voltages of all nodes (V, line-to-ground); zero where the substation does not reach
    S_source: complex  # power out of the substation (VA)
    S_loads: complex  # power taken by all loads of any kind (VA)
    S_losses: complex  # power taken by lines and transformers (VA); the imaginary part includes line charging
    S_capacitors: complex  # power taken by capacitor banks (VA); their imaginary part is negative
    iterations: int  # number of network solutions


def solve_power_flow(
    network: Network,
    closed: frozenset[str],
    *,
    shunt: Complex | None = None,
    injection: Injection | None = None,
    tolerance: float = 1e-10,
    start: Complex | None = None,
) -> PowerFlow:
    """Solve the nodes that the substation reaches by the fixed point V <- Y^-1 (J(V) - I_load(V) - Y_s V_s).

    `shunt`: admittances to ground added at the nodes (S); `injection`: currents fed in (A) from voltages (V);
    `tolerance`: largest change of any voltage in the last iteration (pu); `start`: voltages (V), by default those
    without load. ValueError if the feeder has no source; ArithmeticError if it does not converge, mostly because it
    cannot carry the load.
    """
    if not len(network.source_nodes):
        raise ValueError(f'feeder "{network.feeder.name}" has no source; a power flow needs one, give source.csv')
    merge = network.merge(closed)
    Y = network.admittance(closed)
    if shunt is not None:
        Y = Y + sp.diags_array(merge.gather(merge.ratio * shunt)).tocsc()
    own = network.loads()
    without_loads = Y
    linear = own.nominal_admittance(len(network.nodes))
    if linear.nnz:  # without the loads' linear part the fixed point diverges where a phase is missing
        T = merge.matrix()
        Y = sp.csc_array(Y + T.T @ linear @ T)
    unknown = _reached(Y, network.source_nodes, own.on(merge))
    solve = factorized(sp.csc_matrix(Y[unknown][:, unknown]))
    from_source = Y[unknown][:, network.source_nodes] @ network.source_voltage

    def rounding(V: Complex) -> float:
        """Return the change (pu) that rounding of the network's currents can make."""
        lost = np.finfo(float).eps * (abs(Y[unknown][:, unknown]) @ np.abs(V))
        return float(np.max(np.abs(solve(lost.astype(complex))) / network.V_nom[unknown], initial=0.0))

    V_rep = np.zeros(len(network.nodes), dtype=np.complex128)
    V_rep[unknown] = (network.nominal if start is None else start)[unknown]
    V_rep[network.source_nodes] = network.source_voltage
    smallest, since = np.inf, 0
    for iteration in range(1, MOST_ITERATIONS + 1):
        V = merge.expand(V_rep)
        net = linear @ V - own.currents(V) if linear.nnz else -own.currents(V)
        if injection is not None:
            net = net + injection(V)
        V_new = solve(merge.gather(net)[unknown] - from_source)
        change = np.abs(V_new - V_rep[unknown]) / network.V_nom[unknown]
        V_rep[unknown] = V_new
        worst = int(np.argmax(change)) if len(change) else 0
        largest = float(change[worst]) if len(change) else 0.0
        if largest < smallest:
            smallest, since = largest, iteration
        stalled = iteration - since >= STALL and (largest < NOISE or largest < rounding(V_rep[unknown]))
        if largest < tolerance or stalled:
            return _balance(network, merge.expand(V_rep), own, injection, shunt, iteration)
        if not np.isfinite(largest):
            break
    if largest < NOISE:  # it converges, but slowly
        return _balance(network, merge.expand(V_rep), own, injection, shunt, iteration)
    bus, phase = network.nodes[unknown[worst]]
    on = own.on(merge)
    C = on.incidence(len(network.nodes)).tocsr()[unknown].tocsc()
    weak = weak_branches(without_loads[unknown][:, unknown], C, on.law, on.V_nom)
    raise ArithmeticError(
        f"power flow did not converge: after {iteration} iterations bus {bus} phase {phase} still changes by "
        f"{largest:.3g} pu; {network.weak_loads(weak)}"
    )


def _reached(Y: sp.csc_array, source: Integers, loads: LoadBranches) -> Integers:
    """Nodes connected to the source through the matrix or through loads (a neutral), without the source's own."""
    between = np.flatnonzero(loads.n_to >= 0)
    ends = (loads.n_from[between], loads.n_to[between])
    through_loads = sp.csr_array((np.ones(between.size), ends), shape=Y.shape)
    _, label = connected_components(sp.csr_array(abs(Y)) + through_loads, directed=False)
    reached = np.isin(label, label[source])
    reached[source] = False
    return np.flatnonzero(reached).astype(np.int64)


def _balance(
    network: Network,
    V: Complex,
    loads: LoadBranches,
    injection: Injection | None,
    shunt: Complex | None,
    iterations: int,
) -> PowerFlow:
    S_loads = complex(loads.powers(V).sum() + V @ np.conj(network.Y_loads @ V))
    S_losses = complex(V @ np.conj(network.Y_branches @ V))
    S_capacitors = complex(V @ np.conj(network.Y_capacitors @ V))
    fed = complex(V @ np.conj(injection(V))) if injection is not None else 0j
    if shunt is not None:
        fed -= complex(V @ np.conj(shunt * V))
    return PowerFlow(
        V=V,
        S_source=S_loads + S_losses + S_capacitors - fed,
        S_loads=S_loads,
        S_losses=S_losses,
        S_capacitors=S_capacitors,
        iterations=iterations,
    )
