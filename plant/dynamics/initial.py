"""The initial operating point of a run: an exact equilibrium of network and inverters (section 7).

The real power of each inverter is given; its reactive power is either given too, or follows from a given V_set through
the droop (4), (8). In an island without a source one GFM (its swing) first holds its terminal, and is then released;
where all its GFM are single-phase, one on each phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from plant.dynamics.circuit import Circuit
from plant.dynamics.error import PlantError
from plant.dynamics.hybrid_root import Root, hybrid_root
from plant.dynamics.inverters import Inverters
from plant.dynamics.kernel.constant_power import NO_NETWORK, settle_powers
from plant.dynamics.phasors import PHASES, aligned_sum
from plant.dynamics.reduction.blas import one_thread
from plant.dynamics.reduction.reduce_network import reduce_network
from plant.dynamics.reduction.reduced import Complex, Real, Reduced

MOST_ROUNDS = 500
"""Most rounds between the network and inverters of constant power."""

MOST_BY_DIFFERENCES = 100
"""Inverters up to which a Jacobian by differences is worth its power flows, one an inverter; else Newton-Krylov."""

KRYLOV = {"fatol": 1e-12, "maxiter": 20, "jac_options": {"rdiff": 1e-6}}
"""Largest deviation (pu), most iterations of Newton's method (it takes 3 to 5), and its relative difference."""

NEAR = 4
"""Rounds after which the voltages are near enough to the solution for a tangent that serves to the end."""


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


class _PowerFlow:
    """Fixed point between the network and inverters of constant power."""

    def __init__(self, circuit: Circuit, units: Inverters, held: NDArray[np.bool_]) -> None:
        # GFM filters stay in the network, because their EMF is balanced, not their current; a GFL is a pure current
        y = np.where(units.forming & ~held, units.y_f, 0.0)
        self.reduction = reduce_network(circuit, y, units.forming, units.connected)
        self.circuit, self.units, self.y = circuit, units, y
        self.V_b = circuit.V_branch[self.reduction.branches].astype(complex)
        self.I_b = np.empty(self.V_b.size, complex)
        """Currents of the live load branches (A), of the last solution."""
        self.net = self._linearise()
        self._near = False

    def _linearise(self) -> Reduced:
        theta = np.zeros(len(self.units))
        return self.reduction.linearise(self.V_b, self.circuit.source_voltage, theta)

    def _renew(self, J: Complex) -> None:
        """Move the tangent to where Newton's method leads: across a limit of the loads' law it does not itself."""
        self.V_b, failed = self.reduction.solve_islands(J, self.circuit.source_voltage, self.V_b)
        if failed:
            raise _no_power_flow()
        self.net = self._linearise()

    def solve(self, J: Complex, P: Real, Q: Real, frozen: NDArray[np.bool_]) -> tuple[Complex, Complex]:
        """Return injections and voltages where every inverter that is not frozen delivers P + jQ (pu)."""
        units, m = self.units, self.V_b.size
        J, V = J.copy(), np.empty(J.shape, complex)
        tolerance, left, renewed = 1e-12 * float(units.V_b.max()), MOST_ROUNDS, False
        while left > 0:
            most = left if self._near else min(left, NEAR)
            x = np.concatenate([self.V_b.real, self.V_b.imag])
            rounds, change = settle_powers(
                most,
                self.net,
                J,
                (P + 1j * Q) * units.S_3,
                self.y,
                units.S_3 / units.V_b,
                ~frozen & self.reduction.online,
                units.balanced,
                x,
                self.I_b,
                V,
                tolerance,
            )
            if rounds == NO_NETWORK:
                if renewed:
                    raise _no_power_flow()
                renewed = True
                self._renew(J)
                continue
            left, renewed = left - rounds, False
            self.V_b = x[:m] + 1j * x[m:]
            if rounds <= most:
                return J, V
            if not self._near:
                self.net, self._near = self._linearise(), True
        raise PlantError(
            f"no initial operating point: injections still change by {change:.1e} pu after {MOST_ROUNDS} iterations; "
            "the inverters may have to deliver more than the network can carry; try another P_set0 or V_set0"
        )


def _no_power_flow() -> PlantError:
    return PlantError(
        "no initial operating point: the power flow did not converge; the load may be more than the "
        "network can carry; try smaller loads or another P_set0"
    )


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
        Voltage set-point of each (pu), from which Q follows by droop; None to keep Q.
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
    flow = _PowerFlow(held, units, swing)
    J = np.zeros((n, 3), complex)
    if V_set is None:
        J, V = flow.solve(J, P, Q, swing)
    else:
        J, V, Q = _by_droop(flow, J, P, Q, V_set, swing)

    if swing.any():
        # the swings' powers determine their EMF; then their buses are released
        node_voltage = flow.reduction.all_voltages(J, flow.I_b, held.source_voltage)
        drawn = circuit.Y @ node_voltage + circuit.C[:, flow.reduction.branches] @ flow.I_b
        S = np.sum(V * np.conj(circuit.turn * drawn[circuit.terminals]), axis=1)
        in_filter = np.sum(V * np.conj(units.y_f[:, None] * V), axis=1)
        V_1 = aligned_sum(V) / 3.0
        J[swing] = np.conj((S + in_filter) / (3.0 * V_1))[swing, None] * PHASES
        flow = _PowerFlow(circuit, units, np.zeros(n, bool))
        J, V = flow.solve(J, P, Q, swing)

    I_out = J - flow.y[:, None] * V
    return OperatingPoint(J=I_out + units.y_f[:, None] * V, V=V, I=I_out, V_branch=flow.V_b)


def _swings(units: Inverters, forming: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the swings among the GFM of an island: the first with three phases, else the first on each phase."""
    whole = forming[~units.single[forming]]
    return whole[:1] if whole.size else forming[np.unique(units.phase[forming], return_index=True)[1]]


def set_equilibrium(
    units: Inverters, point: OperatingPoint, online: NDArray[np.bool_], P: Real, V_set: Real | None
) -> None:
    """Set the inverters' set-points and controller states so that they rest at an operating point.

    Parameters
    ----------
    units
        The inverters; written.
    point
        Operating point.
    online
        Inverters that deliver; the others keep their states, with `P` and `V_set` as set-points.
    P, V_set
        Real powers and set-points of the point (pu). Without `V_set` a GFL rests at its voltage and its reactive power,
        V_set := v, Q_set := q; else all the reactive power comes from the droop.
    """
    S, v = units.measured(point.V, point.I)
    held = units.regulated(point.V, point.I)
    units.J, units.V, units.I = point.J.copy(), point.V.copy(), point.I.copy()
    for i in range(len(units)):
        if not online[i]:
            units.set_points[i] = P[i], 1.0 if V_set is None else V_set[i], 0.0
            continue
        if units.forming[i] or V_set is not None:
            units.set_points[i] = S[i].real, held[i] + units.m_q[i] * S[i].imag, 0.0
        else:
            units.set_points[i] = S[i].real, v[i], S[i].imag
        units.rest(i, S[i], v[i])


def _by_droop(
    flow: _PowerFlow, J: Complex, P: Real, Q: Real, V_set: Real, swing: NDArray[np.bool_]
) -> tuple[Complex, Complex, Real]:
    """Find the Q at which V_set - m_q Q is each terminal's voltage, within the apparent-power limit."""
    units = flow.units
    free = np.flatnonzero(~swing & flow.reduction.online)
    if not free.size:  # swings alone: they hold their voltage, and nothing is left to find
        return *flow.solve(J, P, Q, swing), Q
    limit = np.sqrt(np.maximum(units.S_max**2 - P**2, 0.0))

    def deviation(q: Real) -> Real:
        nonlocal J
        trial = Q.copy()
        trial[free] = q
        J, V = flow.solve(J, P, trial, swing)
        I_out = J - flow.y[:, None] * V
        by_droop = np.clip((V_set - units.regulated(V, I_out)) / units.m_q, -limit, limit)
        measured = np.where(units.positive_sequence, units.measured(V, I_out)[0].imag, trial)
        return np.asarray((by_droop - measured)[free] * units.m_q[free])

    solution: Root | None = None
    if free.size > MOST_BY_DIFFERENCES:
        from scipy.optimize import root  # its import takes longer than the start of a small plant

        with one_thread():
            found = root(deviation, Q[free], method="krylov", options=KRYLOV)
        solution = Root(found.x, found.fun, bool(found.success))
    if solution is None or not solution.success:
        solution = hybrid_root(deviation, Q[free], 1e-13)
    if not solution.success and float(np.max(np.abs(solution.fun))) > 1e-10:
        raise PlantError(
            "no initial operating point: V_set0 cannot be met by droop, "
            f"mismatch {np.max(np.abs(solution.fun)):.1e} pu; try another V_set0"
        )
    Q = Q.copy()
    Q[free] = solution.x
    J, V = flow.solve(J, P, Q, swing)
    return J, V, Q


def require_within_limits(units: Inverters, online: NDArray[np.bool_]) -> None:
    """Raise PlantError if the start is no equilibrium: a GFM that forms an island must be within its limits."""
    for k, i in enumerate(units.gfm_at.tolist()):
        if not online[i]:
            continue
        unit, limits, state = units.units[i], units.gfm[k], units.gfm_state[k]
        for what, value, base, symbol, low, high in (
            ("give", units.set_points[i, 0], unit.S_b / 1e3, "kW", "P_min", "P_max"),
            ("give", state["q"], unit.S_b / 1e3, "kvar", "Q_min", "Q_max"),
            ("have an internal voltage of", state["E"], 1.0, "pu", "E_min", "E_max"),
        ):
            if not limits[low] - 1e-9 <= value <= limits[high] + 1e-9:
                raise PlantError(
                    f"no equilibrium at t = 0: {unit.name} would have to {what} {value * base:.5g} {symbol}, "
                    f"it can from {limits[low] * base:.5g} to {limits[high] * base:.5g} {symbol} ({low}_pu, "
                    f"{high}_pu of [plant.gfm]); set another P_set0_pu or V_set0_pu, or change its load"
                )
        current, most = float(np.max(np.abs(units.I[i]))), float(limits["I_limit"])
        if current > most * (1.0 + 1e-9):
            raise PlantError(
                f"no equilibrium at t = 0: {unit.name} would have to carry {current:.5g} A in a phase, it can carry "
                f"{most:.5g} A (I_max_pu of [plant.gfm]); set another P_set0_pu, or change its load"
            )
