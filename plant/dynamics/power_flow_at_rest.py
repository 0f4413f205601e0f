"""The network between inverters of constant power, and the reactive powers that their characteristics give at rest.

A volt-var characteristic may jump at the edge of its dead band, from 0 to db / m_q. An inverter that rests on neither
side holds its voltage on the edge by a Q in between. With that Q the characteristic has no gap and never rises with the
voltage; so where vars raise voltages, there is one operating point, and only one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import root

from gridpeers.plant.dynamics.circuit import Circuit, NoPowerFlowError, PlantError
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.network_arrays import Reduced
from gridpeers.plant.dynamics.kernel.solve import NO_NETWORK, settle_powers
from gridpeers.plant.dynamics.reduction import Reduction

MOST_ROUNDS = 500  # rounds between network and inverters, within which the changes of injections must end or halve
NEAR = 4  # rounds after which the voltages are near enough to the solution for a tangent that serves to the end


class InverterPowerFlow:
    def __init__(self, circuit: Circuit, units: Inverters, held: Flags) -> None:
        # GFM filters stay in the network, because their EMF is balanced, not their current; a GFL is a pure current
        y = np.where(units.forming & ~held, units.y_f, 0.0)
        self.reduction = Reduction(circuit, y, units.forming, units.connected)
        self.circuit, self.units, self.y = circuit, units, y
        self.V_b = circuit.V_branch[self.reduction.branches].astype(complex)
        self.I_b = np.empty(self.V_b.size, complex)  # currents of the live load branches (A), of the last solution
        self.net = self._linearise()
        self._near = False

    def _linearise(self) -> Reduced:
        theta = np.zeros(len(self.units))
        return self.reduction.linearise(self.V_b, self.circuit.source_voltage, theta)

    def solve(self, J: Complex, P: Real, Q: Real, frozen: Flags) -> tuple[Complex, Complex]:
        """Return injections and voltages where every inverter that is not frozen delivers P + jQ (pu)."""
        units, m = self.units, self.V_b.size
        J, V = J.copy(), np.empty(J.shape, complex)
        highest = units.V_b if len(units) else np.abs(self.circuit.V_branch)
        tolerance, left, renewed = 1e-12 * float(highest.max(initial=0.0)), MOST_ROUNDS, False
        total, before = MOST_ROUNDS, 1.0
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
                # a tangent does not lead across a limit of the loads' law; Newton's method does
                self.V_b, failed = self.reduction.solve_islands(J, self.circuit.source_voltage, self.V_b)
                if failed or renewed:
                    raise NoPowerFlowError(self.reduction.weak_branches())
                self.net, renewed = self._linearise(), True
                continue
            left, renewed = left - rounds, False
            self.V_b = x[:m] + 1j * x[m:]
            if rounds <= most:
                return J, V
            if not self._near:
                self.net, self._near = self._linearise(), True
            if left <= 0 and change < 0.5 * before:
                left, total, before = MOST_ROUNDS, total + MOST_ROUNDS, change
        raise PlantError(
            f"no initial operating point: injections still change by {change:.1e} pu after {total} iterations; "
            "the inverters may have to deliver more than the network can carry; try another P_set0 or V_set0"
        )


DROOP, INSIDE, UNDER, OVER = range(4)
AT_ONCE = 8  # rounds in which all inverters may change place; then the first alone (Murty's least-index rule)


class VoltVarAtRest(NamedTuple):
    V_set: Real  # pu
    m_q: Real  # pu per pu
    db_UV: Real  # dead bands below V_set (pu); 0 for a GFM, infinite without volt-var
    db_OV: Real  # the same above V_set
    from_edge: Flags  # whether the droop begins at the band's edge: no jump; the place is always `DROOP`
    Q_min: Real  # limits of reactive power (pu)
    Q_max: Real

    def first_places(self) -> Integers:
        return np.where(((self.db_UV > 0.0) | (self.db_OV > 0.0)) & ~self.from_edge, INSIDE, DROOP)

    def beyond(self, v: Real) -> Real:
        """Return the deviation on which the droop acts (pu): from V_set, or from the edge of the band."""
        low = self.V_set - v
        return np.where(self.from_edge, low - np.clip(low, -self.db_OV, self.db_UV), low)

    def within(self) -> Real:
        return np.clip(np.zeros(self.m_q.size), self.Q_min, self.Q_max)

    def mismatch(self, place: Integers, v: Real, Q: Real) -> Real:
        """Return how far (pu of voltage) Q at voltages v is from rest at these places."""
        low = self.V_set - v
        wanted = np.clip(self.beyond(v) / self.m_q, self.Q_min, self.Q_max)
        off = (np.where(place == INSIDE, self.within(), wanted) - Q) * self.m_q
        off = np.where(place == UNDER, low - self.db_UV, off)
        return np.where(place == OVER, low + self.db_OV, off)

    def next_places(self, place: Integers, v: Real, Q: Real, rounds: int) -> Integers:
        """Return where inverters belong that rest with Q at v (pu); the same places once they are right."""
        low = self.V_set - v
        within = (-self.db_OV < low) & (low < self.db_UV) & ~self.from_edge
        band, limit = (
            np.where(place == UNDER, *pair) for pair in ((self.db_UV, self.db_OV), (self.Q_max, -self.Q_min))
        )
        on_jump = np.minimum(band / self.m_q, limit)
        inward = np.where(place == UNDER, Q, -Q)  # of an inverter on an edge: what holds its voltage there
        edge = np.where(Q > 0.0, UNDER, OVER)
        edge = np.where(np.isinf(np.where(Q > 0.0, self.db_UV, self.db_OV)), INSIDE, edge)
        right = np.where((place == INSIDE) & ~within, DROOP, place)
        right = np.where((place == DROOP) & within, edge, right)
        on_edge = (place == UNDER) | (place == OVER)
        right = np.where(on_edge & (inward <= 0.0), INSIDE, right)
        right = np.where(on_edge & (inward > on_jump), DROOP, right)
        if rounds < AT_ONCE:
            return right
        changed = place.copy()
        first = np.flatnonzero(right != place)[:1]
        changed[first] = right[first]
        return changed


MOST_BY_DIFFERENCES = 100  # inverters up to which a Jacobian by differences pays; else Newton-Krylov

KRYLOV = {"fatol": 1e-12, "maxiter": 20, "jac_options": {"rdiff": 1e-6}}

MOST_PLACE_ROUNDS = 100  # rounds in which inverters may change their place at dead bands; 2 to 4 on our feeder


def solve_by_droop(
    flow: InverterPowerFlow, J: Complex, P: Real, Q: Real, V_set: Real, swing: Flags
) -> tuple[Complex, Complex, Real, Flags, Flags]:
    """Find the Q (pu) that each characteristic gives at its terminal's voltage; J and Q are first guesses.

    Return injections (A), terminal voltages (V), Q, and the flags `on_droop` and `on_edge` of `OperatingPoint`.
    `swing`: inverters that hold their voltage, whatever their droop. PlantError if there are none such Q.
    """
    units = flow.units
    free = ~swing & flow.reduction.online
    S_max, Q_min, Q_max, db_UV, db_OV, from_edge = units.volt_var
    limit = np.sqrt(np.maximum(S_max**2 - P**2, 0.0))
    low, high = np.maximum(-limit, Q_min), np.minimum(limit, Q_max)
    at_rest = VoltVarAtRest(V_set, units.m_q, db_UV, db_OV, from_edge > 0.0, low, high)
    place = np.where(free, at_rest.first_places(), DROOP)
    for rounds in range(MOST_PLACE_ROUNDS):
        J, V, Q = _at_places(flow, J, P, Q, at_rest, place, np.flatnonzero(free), swing)
        v = units.regulated(V, J - flow.y[:, None] * V)
        right = np.where(free, at_rest.next_places(place, v, Q, rounds), DROOP)
        if np.array_equal(right, place):
            deviation = V_set - v
            on_droop = (place == DROOP) & (low * units.m_q <= deviation) & (deviation <= high * units.m_q)
            on_droop &= at_rest.beyond(v) == deviation
            return J, V, Q, on_droop | ~free, (place == UNDER) | (place == OVER)
        place = right
    raise PlantError(
        "no initial operating point: the GFL within their dead bands (db_UV_pu, db_OV_pu) cannot be determined; "
        "try another V_set0"
    )


def _at_places(
    flow: InverterPowerFlow,
    J: Complex,
    P: Real,
    Q: Real,
    at_rest: VoltVarAtRest,
    place: Integers,
    free: Integers,
    swing: Flags,
) -> tuple[Complex, Complex, Real]:
    if not free.size:  # swings alone: they hold their voltage, and nothing is left to find
        return *flow.solve(J, P, Q, swing), Q
    units = flow.units

    def mismatch(change: Real) -> Real:
        nonlocal J
        trial = Q.copy()
        trial[free] += change  # from 0: differences relative to a Q near 0 would vanish
        J, V = flow.solve(J, P, trial, swing)
        I_out = J - flow.y[:, None] * V
        measured = np.where(units.positive_sequence, units.measured(V, I_out)[0].imag, trial)
        return np.asarray(at_rest.mismatch(place, units.regulated(V, I_out), measured)[free])

    solution = None
    if free.size > MOST_BY_DIFFERENCES:
        solution = root(mismatch, np.zeros(free.size), method="krylov", options=KRYLOV)
    if solution is None or not solution.success:
        solution = root(mismatch, np.zeros(free.size), method="hybr", options={"xtol": 1e-13})
    if not solution.success and float(np.max(np.abs(solution.fun))) > 1e-10:
        raise PlantError(
            "no initial operating point: V_set0 cannot be met by droop, "
            f"mismatch {np.max(np.abs(solution.fun)):.1e} pu; try another V_set0"
        )
    Q = Q.copy()
    Q[free] += solution.x
    Q = np.where(place == INSIDE, at_rest.within(), Q)
    J, V = flow.solve(J, P, Q, swing)
    return J, V, Q
