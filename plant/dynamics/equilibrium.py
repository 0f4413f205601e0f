"""The initial operating point of a run: an exact equilibrium of network and inverters.

In an island without a source the first GFM with three phases (its swing) first holds its terminal, and is then
released; where all its GFM are single-phase, the first on each phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gridpeers.plant.dynamics.circuit import PHASES, Circuit, PlantError, aligned_sum
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Real
from gridpeers.plant.dynamics.power_flow_at_rest import InverterPowerFlow, solve_by_droop


@dataclass(frozen=True, kw_only=True)
class OperatingPoint:
    """Injections and voltages of an equilibrium, n_inv x 3 each."""

    J: Complex  # Norton injections (A)
    V: Complex  # terminal voltages (V)
    I: Complex  # noqa: E741  # the paper's symbol for current
    V_branch: Complex  # voltages of the live load branches (V)
    on_droop: Flags  # inverters whose voltage is V_set - m_q q, not in a dead band or at the limit of Q
    on_edge: Flags  # inverters on the edge of a dead band: their Q will hunt around that of this point


def equilibrium(
    circuit: Circuit, units: Inverters, P: Real, Q: Real, V_set: Real | None, *, swing_voltage: Complex = PHASES
) -> OperatingPoint:
    """Return the operating point; PlantError if there is none.

    `P`: real power of each inverter (pu), ignored for a swing; `Q`: reactive power (pu), or the first guess where
    `V_set` (pu) is given, from which Q follows by droop (4), (8) and dead band; `swing_voltage`: phasors that a swing
    holds (pu).
    """
    n, online = len(units), units.connected
    _, label = circuit.components()
    island = label[circuit.terminals[:, 0]]
    sourced = np.isin(island, label[circuit.sources])
    swing = np.zeros(n, bool)
    for k in np.unique(island[units.forming & online & ~sourced]):
        forming = np.flatnonzero((island == k) & units.forming & online)
        whole = forming[~units.single[forming]]
        first_on_each_phase = np.unique(units.phase[forming], return_index=True)[1]
        swing[whole[:1] if whole.size else forming[first_on_each_phase]] = True

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
    flow = InverterPowerFlow(held, units, swing)
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
        flow = InverterPowerFlow(circuit, units, np.zeros(n, bool))
        J, V = flow.solve(J, P, Q, swing)

    I_out = J - flow.y[:, None] * V
    J = I_out + units.y_f[:, None] * V
    return OperatingPoint(J=J, V=V, I=I_out, V_branch=flow.V_b, on_droop=on_droop, on_edge=on_edge)


def set_equilibrium(units: Inverters, point: OperatingPoint, online: Flags, P: Real, V_set: Real | None) -> None:
    """Set set-points and controller states so that inverters rest at an operating point.

    Without `V_set` (pu) a GFL rests at its voltage and reactive power, V_set := v, Q_set := q; else all the reactive
    power comes from the droop, within dead band and limit.
    """
    S, v = units.measured(point.V, point.I)
    held = units.regulated(point.V, point.I)
    units.J, units.V, units.I = point.J.copy(), point.V.copy(), point.I.copy()
    for i in range(len(units)):
        if not online[i]:
            units.set_points[i] = P[i], 1.0 if V_set is None else V_set[i], 0.0
            continue
        if units.forming[i] or (V_set is not None and point.on_droop[i]):
            units.set_points[i] = S[i].real, held[i] + units.m_q[i] * S[i].imag, 0.0
        elif V_set is not None:
            units.set_points[i] = S[i].real, V_set[i], 0.0
        else:
            units.set_points[i] = S[i].real, v[i], S[i].imag
        units.rest(i, S[i], v[i])


def require_within_limits(units: Inverters, online: Flags) -> None:
    """Raise PlantError if the start is no equilibrium: a GFM that forms an island must be within its limits."""
    S, _ = units.measured(units.V, units.I)
    words = {"P": "P of", "Q": "Q of", "E": "an internal voltage of"}
    for i in np.flatnonzero(units.forming & online).tolist():
        unit, E = units.units[i], abs(units.J[i, 0] / units.y_f[i]) / units.V_b[i]
        values = {"P": units.set_points[i, 0], "Q": S[i].imag, "E": E}
        for what, symbol, lowest, highest in unit.parameters.BOUNDS_AT_REST:
            value, base = values[what], 1.0 if symbol == "pu" else unit.S_b / 1e3
            low, high = getattr(unit.parameters, lowest), getattr(unit.parameters, highest)
            if not low - 1e-9 <= value <= high + 1e-9:
                raise PlantError(
                    f"no equilibrium at t = 0: {unit.name} needs {words[what]} {value * base:.5g} {symbol}; its limits "
                    f"are {low * base:.5g} and {high * base:.5g} {symbol} ({lowest}_pu, {highest}_pu of [plant.gfm]); "
                    "set another P_set0_pu or V_set0_pu, or change its load"
                )
        current, most = float(np.max(np.abs(units.I[i]))), float(units.I_limit[i])
        if current > most * (1.0 + 1e-9):
            raise PlantError(
                f"no equilibrium at t = 0: {unit.name} needs {current:.5g} A in a phase; its limit is "
                f"{most:.5g} A (I_max_pu of [plant.gfm]); set another P_set0_pu, or change its load"
            )
