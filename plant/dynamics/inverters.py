"""The inverters of a circuit as arrays: their parameters, and the state that steps and switching change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.circuit import PlantError, aligned_sum
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Real
from gridpeers.plant.dynamics.kernel.model_pass import TERMINAL, THETA, F, W, parameters_of, state_of
from gridpeers.plant.dynamics.kernel.second_order_step import FeedForward
from gridpeers.plant.equipment import F_NOM
from gridpeers.plant.inverters.inverter_model import InverterModel, Kind, Method, UnitRating
from gridpeers.wire.plugins.registry import ANYTHING, line_of, named


@dataclass(frozen=True, kw_only=True)
class Inverter:
    name: str
    kind: Kind
    phases: str = "ABC"  # phases of its terminal: all three, or one
    S_b: float  # rating, base of its per-unit quantities (VA)
    V_b: float  # nominal voltage (V, line-to-neutral)
    m_p: float  # P-f droop (pu per pu)
    m_q: float  # Q-V droop (pu per pu)
    parameters: InverterModel
    f_nom: float = F_NOM  # nominal frequency (Hz), base of its per-unit frequency; one for all inverters of a circuit

    @property
    def single(self) -> bool:
        return len(self.phases) == 1

    @property
    def S_3(self) -> float:
        """Base of the powers of three such phases together (VA)."""
        return 3.0 * self.S_b if self.single else self.S_b

    @property
    def rating(self) -> UnitRating:
        return UnitRating(self.S_3, self.V_b, self.m_p, self.m_q, self.f_nom)


class Inverters:
    """All inverters of a circuit, in the order of its terminals.

    It has the tables of `kernel.controller_pass.Units`, of which `constants` and `state_of` show a row as a record;
    `single`: single-phase inverters: to the models they have three equal phases (`Circuit.copies`), of base `S_3`;
    `phase`: phase of the first terminal: 0, 1, 2 for A, B, C; `positive_sequence`, `direct`: inverters that measure the
    positive sequence, and those whose internal voltage the droop gives; `volt_var`: rows of `VoltVar`; `y_f`:
    filter admittances in the network (S per phase); 0 for a current source, as which the method "second-order" solves
    those of `feed_forward`; `I_limit`: limits of their phase currents (A); `set_points`: P_set, V_set, Q_set (pu), n x
    3, may be written between steps; `J`, `V`, `I`: Norton injections (A), terminal voltages (V), currents out of the
    inverters (A), n x 3; `limiting`: inverters whose phase currents were limited in the last network solution.
    """

    def __init__(
        self, units: tuple[Inverter, ...], connected: Sequence[bool] | None = None, method: Method = "first-order"
    ) -> None:
        n = len(units)
        self.units = units
        models = [unit.parameters for unit in units]
        self.f_nom = units[0].f_nom if units else F_NOM
        self.forming = np.array([unit.kind == "GFM" for unit in units], dtype=bool)
        self.S_b = np.array([unit.S_b for unit in units])
        self.single = np.array([unit.single for unit in units], dtype=bool)
        self.S_3 = np.array([unit.S_3 for unit in units])
        self.phase = np.array(["ABC".index(unit.phases[0]) for unit in units], dtype=np.int64)
        self.V_b = np.array([unit.V_b for unit in units])
        self.m_p = np.array([unit.m_p for unit in units])
        self.m_q = np.array([unit.m_q for unit in units])
        self.balanced = np.array([model.equal_powers for model in models], dtype=bool)
        self.positive_sequence = np.array([model.measures_positive_sequence for model in models], dtype=bool)
        self.direct = np.array([not model.holds_terminal for model in models], dtype=bool)
        self.volt_var = np.array([model.volt_var_at_rest() for model in models], float).reshape(n, 6).T
        self.P_set_lim = np.array([model.P_set_lim for model in models])
        self.V_set_min = np.array([model.V_set_min for model in models])
        self.V_set_max = np.array([model.V_set_max for model in models])
        self.I_limit = np.array([unit.parameters.current_limit * unit.S_3 / (3.0 * unit.V_b) for unit in units])
        self.feed_forward = _feed_forward(units, self.S_3, self.V_b)
        in_rounds = np.array([method == "second-order" and model.feedback() is not None for model in models], bool)
        filters = [model.admittance(unit.rating) for model, unit in zip(models, units, strict=True)]
        self.y_f = np.where(in_rounds, 0.0, np.array(filters, complex))
        self._records = [(parameters_of(type(model)), state_of(type(model))) for model in models]
        self.parameters = np.zeros((n, max((it.itemsize for it, _ in self._records), default=0)), np.uint8)
        self.state = np.zeros((n, max((it.itemsize for _, it in self._records), default=0) // 8))
        self.start, self.slope = np.zeros_like(self.state), np.zeros_like(self.state)
        self.passes, self.terminal = np.zeros(n, np.int64), np.zeros(n, TERMINAL)
        for i, (unit, y_f) in enumerate(zip(units, self.y_f.tolist(), strict=True)):
            if wrong := unit.parameters.objection(method):
                raise ValueError(wrong)
            record = self.constants(i)
            for name, value in unit.parameters.values(unit.rating, y_f).items():
                record[name] = value
        self.connected = np.ones(n, bool) if connected is None else np.array(connected, dtype=bool)
        self.set_points = np.zeros((n, 3))
        self.J, self.J_0, self.V, self.I = (np.zeros((n, 3), complex) for _ in range(4))
        self.limiting, self.online = np.zeros(n, bool), np.zeros(n, bool)

    def __len__(self) -> int:
        return len(self.units)

    def constants(self, i: int) -> NDArray[np.void]:
        """Return the parameters of one inverter: a record of the same memory."""
        record = self._records[i][0]
        return self.parameters[i, : record.itemsize].view(record)[0]  # type: ignore[no-any-return]

    def state_of(self, i: int) -> NDArray[np.void]:
        record = self._records[i][1]
        return self.state[i, : record.itemsize // 8].view(record)[0]  # type: ignore[no-any-return]

    def theta(self) -> Real:
        """Return the angle of every GFM's internal voltage (rad); 0 for a GFL."""
        return np.where(self.forming, self.state[:, THETA], 0.0)

    def measured(self, V: Complex, I: Complex) -> tuple[Complex, Real]:  # noqa: E741  # the paper's symbol
        """Return the powers and voltages (pu) that controllers measure, from V (V) and I (A)."""
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
        """Set a controller to rest at its present J, V and I, and the power and voltage (pu) that it measures.

        PlantError if its model, perhaps a user's, fails or leaves a state that is no number.
        """
        self.state[i, W], self.state[i, F] = 0.0, self.f_nom
        own, state = self.constants(i), self.state_of(i)
        model = self.units[i].parameters
        where = f"{self.units[i].name}: rest of the inverter model {type(model).__name__}"
        try:
            model.rest(own, state, self.V[i], self.I[i], self.J[i], S, v)
        except ANYTHING as error:  # a model may be a user's own
            raise PlantError(f"{where} fails{line_of(model.rest, error)}: {named(error)}") from error
        named_states = zip(state.dtype.names or (), state, strict=True)
        if wrong := [f"{name} = {value}" for name, value in named_states if value != value]:
            raise PlantError(f"{where} gives {', '.join(wrong)}; every state must be a number there")

    def lock(self, i: int, w: float) -> None:
        """Let a controller at rest turn with an island (rad/s, relative to nominal) that it enters."""
        self.state[i, W], self.state[i, F] = w, self.f_nom + w / (2.0 * np.pi)
        self.units[i].parameters.locked(self.state_of(i), w, float(self.state[i, F]))

    def hold(self, i: int, P_set: float, V_set: float) -> tuple[float, float]:
        """Take set-points (pu) from the next step on, within the inverter's bounds; return the held ones.

        A GFL's P_set is clipped before the droop (7) is added, as in GridLAB-D: so a set-point beyond the rating
        does not cancel the droop of a later over-frequency.
        """
        limit = self.P_set_lim.item(i)
        P_set = float(min(max(P_set, -limit), limit))
        V_set = float(min(max(V_set, self.V_set_min.item(i)), self.V_set_max.item(i)))
        self.set_points[i, 0], self.set_points[i, 1] = P_set, V_set
        return P_set, V_set

    def require_finite(self) -> None:
        """Raise PlantError if the model of an inverter gave a current or a state that is no finite number."""
        finite = np.isfinite(self.J).all(axis=1) & np.isfinite(self.state).all(axis=1)
        for i in np.flatnonzero(~finite).tolist():
            model = type(self.units[i].parameters).__name__
            raise PlantError(
                f"{self.units[i].name}: the inverter model {model} gives a current or a state that is no finite number"
            )

    def limit_power(self, i: int, P_max: float) -> None:
        """Bound a GFL's P reference (W) from the next step on; a scenario that bounds a GFM is refused."""
        self.constants(i)["P_max"] = P_max / self.S_b[i]

    def readings(self, online: Flags) -> Real:
        """Return f (Hz), P (W), Q (var), V (V) of the last solution, n x 4, before the first step.

        An inverter that is not `online` has nominal f, or 0 without voltage, and no power.
        """
        S = np.sum(self.V * np.conj(self.J - self.y_f[:, None] * self.V), axis=1)
        S[self.single] /= 3.0
        S[~online] = 0.0
        f = np.where(online, self.state[:, F], self.f_nom)
        V = np.mean(np.abs(self.V), axis=1)
        f[~online & (V == 0.0)] = 0.0
        return np.column_stack([f, S.real, S.imag, V])


def _feed_forward(units: tuple[Inverter, ...], S_3: Real, V_b: Real) -> FeedForward:
    y, a = np.zeros(len(units), complex), np.zeros(len(units), complex)
    for i, unit in enumerate(units):
        if (slope := unit.parameters.feedback()) is not None:
            y[i], a[i] = unit.parameters.admittance(unit.rating), slope
    return FeedForward(y, np.reciprocal(1.0 - a), S_3 / (3.0 * V_b), float(V_b.max(initial=1.0)))
