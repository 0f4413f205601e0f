"""The initial operating point of a run: an exact equilibrium of network and inverters (section 7).

The real power of each inverter is given; its reactive power is either given too, or follows from a given V_set through
the droop (4), (8) and its dead band. In an island without a source one GFM (its swing) first holds its terminal, and is
then released; where all its GFM are single-phase, one on each phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.circuit import Circuit
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.phasors import PHASES, aligned_sum
from gridpeers.plant.dynamics.reduction.reduced import Complex, Real
from gridpeers.plant.dynamics.start.by_droop import solve_by_droop
from gridpeers.plant.dynamics.start.power_flow import PowerFlow


@dataclass(frozen=True, kw_only=True)
class OperatingPoint:
    """Injections and voltages of an equilibrium, n_inv x 3 each."""

    J: Complex
    """Norton injections (A)."""
    V: Complex
    """Terminal voltages (V)."""
    I: Complex  # noqa: E741  # the paper's symbol for current
    """Currents out of the inverters (A)."""
    V_branch: Complex
    """Voltages of the live load branches (V)."""
    on_droop: NDArray[np.bool_]
    """Inverters whose voltage is V_set - m_q q; the others are within a dead band, or at the limit of their Q."""
    on_edge: NDArray[np.bool_]
    """Inverters on the edge of a dead band: there is no rest, and Q will hunt around that of this point."""


def equilibrium(
    circuit: Circuit,
    units: Inverters,
    P: Real,
    Q: Real,
    V_set: Real | None,
    *,
    swing_voltage: Complex = PHASES,
) -> OperatingPoint:
    """Return the operating point of section 7.

    Parameters
    ----------
    circuit
        The network at the start.
    units
        The inverters; disconnected ones take no part.
    P
        Real power of each (pu); ignored for a swing.
    Q
        Reactive power of each (pu), or the first guess where `V_set` is given.
    V_set
        Voltage set-point of each (pu), from which Q follows by droop and dead band; None to keep Q.
    swing_voltage
        Phasors that a swing holds on its three phases (pu of nominal).

    Raises
    ------
    PlantError
        If there is no such point.
    """
    n, online = len(units), units.connected
    _, label = circuit.components()
    island = label[circuit.terminals[:, 0]]
    sourced = np.isin(island, label[circuit.sources])
    swing = np.zeros(n, bool)
    for k in np.unique(island[units.forming & online & ~sourced]):
        swing[_swings(units, np.flatnonzero((island == k) & units.forming & online))] = True

    held = circuit
    if swing.any():
        own = ~circuit.copies[swing]
        nodes = circuit.terminals[swing][own]
        of_phase = swing_voltage[(units.phase[swing, None] + np.arange(3)) % 3]
        at_swing = (units.V_b[swing, None] * of_phase)[own]
        held = replace(
            circuit,
            sources=np.concatenate([circuit.sources, nodes]),
            source_voltage=np.concatenate([circuit.source_voltage, at_swing]),
        )
    flow = PowerFlow(held, units, swing)
    J = np.zeros((n, 3), complex)
    on_droop, on_edge = np.ones(n, bool), np.zeros(n, bool)
    if V_set is None:
        J, V = flow.solve(J, P, Q, swing)
    else:
        J, V, Q, on_droop, on_edge = solve_by_droop(flow, J, P, Q, V_set, swing)

    if swing.any():
        # the swings' powers determine their EMF; then their buses are released
        node_voltage = flow.reduction.all_voltages(J, flow.I_b, held.source_voltage)
        drawn = circuit.Y @ node_voltage + circuit.C[:, flow.reduction.branches] @ flow.I_b
        S = np.sum(V * np.conj(circuit.turn * drawn[circuit.terminals]), axis=1)
        in_filter = np.sum(V * np.conj(units.y_f[:, None] * V), axis=1)
        V_1 = aligned_sum(V) / 3.0
        J[swing] = np.conj((S + in_filter) / (3.0 * V_1))[swing, None] * PHASES
        flow = PowerFlow(circuit, units, np.zeros(n, bool))
        J, V = flow.solve(J, P, Q, swing)

    I_out = J - flow.y[:, None] * V
    J = I_out + units.y_f[:, None] * V
    return OperatingPoint(J=J, V=V, I=I_out, V_branch=flow.V_b, on_droop=on_droop, on_edge=on_edge)


def _swings(units: Inverters, forming: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the swings among the GFM of an island: the first with three phases, else the first on each phase."""
    whole = forming[~units.single[forming]]
    return whole[:1] if whole.size else forming[np.unique(units.phase[forming], return_index=True)[1]]
