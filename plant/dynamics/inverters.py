"""The inverters of a circuit as arrays: their parameters, and the state that steps and switching change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.circuit import aligned_sum
from gridpeers.plant.dynamics.kernel import gfl as gfl_model
from gridpeers.plant.dynamics.kernel import gfm as gfm_model
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Integers, Real
from gridpeers.plant.dynamics.kernel.second_order_step import FeedForward
from gridpeers.plant.equipment import F_NOM
from gridpeers.plant.equipment.inverter_parameters import GflParameters, GfmParameters
from gridpeers.plant.plant_config import Method


@dataclass(frozen=True, kw_only=True)
class Inverter:
    name: str
    kind: Literal["GFM", "GFL"]
    phases: str = "ABC"  # phases of its terminal: all three, or one
    S_b: float  # rating, base of its per-unit quantities (VA)
    V_b: float  # nominal voltage (V, line-to-neutral)
    m_p: float  # P-f droop (pu per pu)
    m_q: float  # Q-V droop (pu per pu)
    parameters: GfmParameters | GflParameters  # parameters of its kind
    f_nom: float = F_NOM  # nominal frequency (Hz), base of its per-unit frequency; one for all inverters of a circuit

    @property
    def single(self) -> bool:
        return len(self.phases) == 1

    @property
    def S_3(self) -> float:
        """Base of the powers of three such phases together (VA)."""
        return 3.0 * self.S_b if self.single else self.S_b


class Inverters:
    """All inverters of a circuit, in the order of its terminals.

    `gfm`, `gfm_at`, `gfm_state`: records of `kernel.gfm`, the inverter each belongs to, and their states; `gfl...`
    likewise; `single`: single-phase inverters: to the models they have three equal phases (`Circuit.copies`), of base
    `S_3`; `phase`: phase of the first terminal: 0, 1, 2 for A, B, C; `positive_sequence`, `direct`: GFM that measure
    the positive sequence, and those without voltage controller (3.8); `S_max`, `Q_min`, `Q_max`: limits (pu), infinite
    for a GFM, whose limiters act in time; `db_UV`, `db_OV`: dead bands of volt-var (pu); 0 for a GFM, infinite for a
    GFL without volt-var; `from_edge`: volt-var begins at their edge; `y_f`: filter admittances in the network (S per
    phase); 0 for a current source, and for every GFL in the method "second-order", which solves its filter together
    with its current controller by `feed_forward`; `set_points`: P_set, V_set, Q_set (pu), n x 3, may be written between
    steps; `J`, `V`, `I`: Norton injections (A), terminal voltages (V), currents out of the inverters (A), n x 3;
    `limiting`: inverters whose phase currents were limited in the last network solution.
    """

    def __init__(
        self, units: tuple[Inverter, ...], connected: Sequence[bool] | None = None, method: Method = "first-order"
    ) -> None:
        n = len(units)
        self.units = units
        self.f_nom = units[0].f_nom if units else F_NOM
        self.forming = np.array([unit.kind == "GFM" for unit in units], dtype=bool)
        self.gfm_at, self.gfl_at = np.flatnonzero(self.forming), np.flatnonzero(~self.forming)
        self.gfm = np.array([_pack(units[i], method) for i in self.gfm_at.tolist()], gfm_model.PARAMETERS)
        self.gfl = np.array([_pack(units[i], method) for i in self.gfl_at.tolist()], gfl_model.PARAMETERS)
        self.gfm_state = np.zeros(self.gfm_at.size, gfm_model.STATE)
        self.gfl_state = np.zeros(self.gfl_at.size, gfl_model.STATE)
        self.S_b = np.array([unit.S_b for unit in units])
        self.single = np.array([unit.single for unit in units], dtype=bool)
        self.S_3 = np.array([unit.S_3 for unit in units])
        self.phase = np.array(["ABC".index(unit.phases[0]) for unit in units], dtype=np.int64)
        self.V_b = np.array([unit.V_b for unit in units])
        self.m_p = np.array([unit.m_p for unit in units])
        self.m_q = np.array([unit.m_q for unit in units])
        self.balanced = _spread(n, self.gfl_at, self.gfl["balanced_power"], False)
        self.positive_sequence = _spread(n, self.gfm_at, self.gfm["positive_sequence"], False)
        self.direct = _spread(n, self.gfm_at, ~self.gfm["voltage_control"], False)
        self.S_max = _spread(n, self.gfl_at, self.gfl["S_max"], np.inf)
        self.Q_min = _spread(n, self.gfl_at, self.gfl["Q_min"], -np.inf)
        self.Q_max = _spread(n, self.gfl_at, self.gfl["Q_max"], np.inf)
        self.from_edge = _spread(n, self.gfl_at, self.gfl["from_edge"], False)
        volt_var = self.gfl["volt_var"]
        self.db_UV = _spread(n, self.gfl_at, np.where(volt_var, self.gfl["db_UV"], np.inf), 0.0)
        self.db_OV = _spread(n, self.gfl_at, np.where(volt_var, self.gfl["db_OV"], np.inf), 0.0)
        self.P_set_lim = np.array([unit.parameters.P_set_lim for unit in units])
        self.V_set_min = np.array([unit.parameters.V_set_min for unit in units])
        self.V_set_max = np.array([unit.parameters.V_set_max for unit in units])
        self.y_f = np.zeros(n, complex)
        self.y_f[self.gfm_at], self.y_f[self.gfl_at] = self.gfm["y_f"], self.gfl["y_f"]
        self.feed_forward = _feed_forward(units, self.S_3, self.V_b)
        self.connected = np.ones(n, bool) if connected is None else np.array(connected, dtype=bool)
        self.set_points = np.zeros((n, 3))
        self.J = np.zeros((n, 3), complex)
        self.V = np.zeros((n, 3), complex)
        self.I = np.zeros((n, 3), complex)
        self.limiting = np.zeros(n, bool)

    def __len__(self) -> int:
        return len(self.units)

    def theta(self) -> Real:
        """Return the angle of every GFM's internal voltage (rad); 0 for a GFL."""
        return _spread(len(self), self.gfm_at, self.gfm_state["theta"], 0.0)

    def measured(self, V: Complex, I: Complex) -> tuple[Complex, Real]:  # noqa: E741  # the paper's symbol
        """Return the powers and voltages (pu) that controllers measure (sections 3.2, 3.8), from V (V) and I (A)."""
        V_1, I_1 = aligned_sum(V) / 3.0, aligned_sum(I) / 3.0
        S = np.where(self.positive_sequence, 3.0 * V_1 * np.conj(I_1), np.sum(V * np.conj(I), axis=1)) / self.S_3
        v = np.where(self.positive_sequence, np.abs(V_1), np.mean(np.abs(V), axis=1)) / self.V_b
        return S, v

    def regulated(self, V: Complex, I: Complex) -> Real:  # noqa: E741  # the paper's symbol
        """Return the voltages (pu) that V_set - m_q q is at rest: measured ones, or E without voltage controller."""
        v = self.measured(V, I)[1]
        i = self.direct
        v[i] = np.abs(I[i, 0] / self.y_f[i] + V[i, 0]) / self.V_b[i]
        return v

    def rest(self, i: int, S: complex, v: float) -> None:
        """Set a controller to rest at its present J, V and I, and the power and voltage (pu) that it measures."""
        if self.forming[i]:
            k = int(np.searchsorted(self.gfm_at, i))
            gfm_model.settle(self.gfm[k], self.gfm_state[k], self.J[i, 0], S, v)
        else:
            k = int(np.searchsorted(self.gfl_at, i))
            gfl_model.settle(self.gfl[k], self.gfl_state[k], self.V[i], self.I[i], S, v)

    def hold(self, i: int, P_set: float, V_set: float) -> tuple[float, float]:
        """Take set-points (pu) from the next step on, within the inverter's bounds; return the held ones.

        A GFL's P_set is clipped before the droop (7) is added, as in GridLAB-D (4.4): so a set-point beyond the rating
        does not cancel the droop of a later over-frequency.
        """
        limit = self.P_set_lim.item(i)
        P_set = float(min(max(P_set, -limit), limit))
        V_set = float(min(max(V_set, self.V_set_min.item(i)), self.V_set_max.item(i)))
        self.set_points[i, 0], self.set_points[i, 1] = P_set, V_set
        return P_set, V_set

    def limit_power(self, i: int, P_max: float) -> None:
        """Bound a GFL's P reference (W) from the next step on; ValueError for a GFM, which has none."""
        if self.forming[i]:
            raise ValueError(f"{self.units[i].name} is grid-forming; only a GFL has a P reference to bound")
        self.gfl["P_max"][self.gfl_at == i] = P_max / self.S_b[i]

    def readings(self, online: Flags) -> Real:
        """Return f (Hz), P (W), Q (var), V (V) of the last solution, n x 4, before the first step.

        An inverter that is not `online` has nominal f, or 0 without voltage, and no power.
        """
        S = np.sum(self.V * np.conj(self.J - self.y_f[:, None] * self.V), axis=1)
        S[self.single] /= 3.0
        S[~online] = 0.0
        f = np.full(S.size, self.f_nom)
        f[self.gfm_at] += np.where(online[self.gfm_at], self.gfm_state["w"], 0.0) / (2.0 * np.pi)
        f[self.gfl_at] = np.where(online[self.gfl_at], self.gfl_state["f"], self.f_nom)
        V = np.mean(np.abs(self.V), axis=1)
        f[~online & (V == 0.0)] = 0.0
        return np.column_stack([f, S.real, S.imag, V])


def _spread(n: int, at: Integers, values: NDArray[Any], other: float) -> NDArray[Any]:
    """Return n values: those of the inverters `at`, and one for the others."""
    every = np.full(n, other, values.dtype)
    every[at] = values
    return every


def _pack(unit: Inverter, method: Method) -> NDArray[np.void]:
    own = unit.S_3, unit.V_b, unit.m_p, unit.m_q, unit.f_nom
    if isinstance(unit.parameters, GfmParameters):
        return gfm_model.pack(unit.parameters, *own)
    return gfl_model.pack(unit.parameters, *own, method)


def _feed_forward(units: tuple[Inverter, ...], S_3: Real, V_b: Real) -> FeedForward:
    y, a = np.zeros(len(units), complex), np.zeros(len(units), complex)
    for i, unit in enumerate(units):
        if isinstance(unit.parameters, GflParameters) and unit.parameters.model == "voltage_source":
            y[i] = gfl_model.filter_admittance(unit.parameters, S_3[i], unit.V_b)
            a[i] = gfl_model.own_feedback(unit.parameters)
    return FeedForward(y, np.reciprocal(1.0 - a), S_3 / (3.0 * V_b), float(V_b.max(initial=1.0)))
