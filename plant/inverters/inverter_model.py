"""The port to models of inverters: what a model must say, and the arithmetic of its compiled pass. Pure, and light.

The plant takes passes. A pass reads the last network solution, advances the states, and writes the injections of the
next solution; a step has two, and for each state x and its slope s the pass says:

    x.q = heun(x0.q, d.q, s, h, second)
    if not second:
        d.q = s

A pass of length h = 0 gives slopes and outputs at the present states, so every method of time stepping takes the same
pass. It is compiled when the plant is built, and so is every function that it calls and that is `compiled`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, inf, pi, sin, sqrt
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeVar

import msgspec

from gridpeers.wire.schema.table_schema import Below, Example, Plausible, Unit

TimeConstant = Annotated[float, Unit("s"), Plausible("a time constant", 1e-5, 10.0, above_zero=True)]
Gain = Annotated[float, Plausible("a gain", 0.0, 1e6)]
Resistance = Annotated[float, Unit("pu"), Plausible("a filter resistance", 0.0, 1.0)]
Reactance = Annotated[float, Unit("pu"), Plausible("a filter reactance", 0.001, 1.0, above_zero=True)]
LimitOfP = Annotated[float, Unit("pu"), Plausible("a limit of P", -2.0, 3.0)]
LimitOfQ = Annotated[float, Unit("pu"), Plausible("a limit of Q", -10.0, 10.0)]
BoundOfPset = Annotated[float, Unit("pu"), Plausible("the bound of P_set", 0.1, 10.0, above_zero=True)]
BoundOfVset = Annotated[float, Unit("pu"), Plausible("a bound of V_set", 0.1, 2.0, above_zero=True)]
PhaseCurrent = Annotated[float, Unit("pu"), Plausible("a limit of a phase's current", 0.5, 1000.0, above_zero=True)]

Kind = Literal["GFM", "GFL"]
Method = Literal["first-order", "second-order"]
F = TypeVar("F", bound=Callable[..., Any])

COMPILED: list[Callable[..., Any]] = []
"""Functions that passes call: the plant compiles them with the first pass, so that a model file imports no compiler."""


def compiled(function: F) -> F:
    """Let passes call this function. It stays a function of Python, which tests may call as it is."""
    COMPILED.append(function)
    return function


A120 = complex(-0.5, 0.5 * sqrt(3.0))  # a = exp(j 120 deg)


@compiled
def heun(x0: float, d1: float, d: float, h: float, second: bool) -> float:
    """Return the predictor x0 + h d, or in the second pass the corrector x0 + h (d1 + d) / 2."""
    if second:
        return x0 + 0.5 * h * (d1 + d)
    return x0 + h * d


@compiled
def sat(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


@compiled
def magnitude(z: complex) -> float:
    """Return the magnitude of a phasor; `abs` takes three times as long, for numbers whose square overflows."""
    return sqrt(z.real * z.real + z.imag * z.imag)


@compiled
def unit_phasor(angle: float) -> complex:
    return complex(cos(angle), sin(angle))


@compiled
def inject(g: Any, t: Any, E: float, theta: float) -> None:
    """Write the injections of an internal voltage E (pu) at an angle (rad), balanced, behind the filter."""
    J_A = E * g.V_b * unit_phasor(theta) * g.y_f
    t.J_A, t.J_B, t.J_C = J_A, J_A * A120.conjugate(), J_A * A120


class UnitRating(NamedTuple):
    """Nameplate of a unit; to a model every unit has three phases."""

    S_b: float  # VA, three phases
    V_b: float  # V, line-to-neutral
    m_p: float  # pu frequency per pu power
    m_q: float  # pu voltage per pu power
    f_nom: float  # Hz

    def constants(self) -> dict[str, float]:
        """Return what every pass finds in its parameters `g` beside those of its model."""
        return {
            "S_b": self.S_b,
            "V_b": self.V_b,
            "I_b": self.S_b / (3.0 * self.V_b),
            "f_nom": self.f_nom,
            "w_nom": 2.0 * pi * self.f_nom,  # rad/s, speed of the common frame
            "m_p": self.m_p * (2.0 * pi * self.f_nom),  # rad/s per pu
            "m_q": self.m_q,
        }


class VoltVar(NamedTuple):
    """Reactive power of a unit at rest: limits (pu) and dead band; by default only the droop."""

    S_max: float = inf  # bounds Q at sqrt(S_max^2 - P^2)
    Q_min: float = -inf
    Q_max: float = inf
    db_UV: float = 0.0  # dead band below V_set (pu); infinite without volt-var
    db_OV: float = 0.0  # the same above
    from_edge: bool = False  # whether the droop begins at the edge of the band


class DroopLag(NamedTuple):
    """Linear response of a GFM: its frequency follows P_set and its filtered power by the droop."""

    T_p: float  # s


class FollowerLag(NamedTuple):
    """Linear response of a GFL: a PLL, a filter of its frequency, and the lag of its power."""

    k_pPLL: float  # rad/s per pu
    k_iPLL: float  # rad/s^2 per pu
    T_ff: float  # s
    T_pf: float  # s
    frequency_watt: bool  # whether its power follows the frequency


class InverterModel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of all inverter models; an object has the parameters of a unit, per unit of its own rating.

    A model sets `kind` and `STATES`, and defines the static methods `advance` and `rest`. Its parameters are fields
    with unit, range, sentence and default; they are keys of `[plant.gfm]` or `[plant.gfl]`. All other members have
    defaults for a voltage behind a filter.
    """

    model: str = ""
    """Name of the model, or `module:Class` of your own."""
    folder: Annotated[str | None, Example('"models"')] = None
    """Folder of the module of your own model; by default that of the scenario."""
    R_f: Annotated[Resistance, "Filter resistance (pu)."] = 0.015
    X_f: Annotated[Reactance, "Filter reactance (pu)."] = 0.15
    P_set_lim: BoundOfPset = 3.0
    """Limit of abs(P_set) (pu). P_set shifts the droop (3), so it may exceed P_max. With 3 pu and 1 % droop, an
    unloaded GFM stays within 3 % of nominal frequency. GridLAB-D has no such limit."""
    V_set_min: Annotated[BoundOfVset, Below("V_set_max"), "Lower bound of V_set (pu)."] = 0.8
    V_set_max: Annotated[BoundOfVset, "Upper bound of V_set (pu)."] = 1.2

    def __post_init__(self) -> None:
        if not self.model:
            msgspec.structs.force_setattr(self, "model", f"{type(self).__module__}:{type(self).__qualname__}")

    def __reduce__(self) -> Any:
        """Find the class by its reference in another process, which may not have its folder on the path."""
        from gridpeers.plant.inverters.inverter_registry import model_of

        return model_of, (msgspec.structs.asdict(self), self.kind)

    kind: ClassVar[Kind] = "GFM"
    """Grid-forming: a voltage behind its filter, which can form an island; or grid-following."""
    STATES: ClassVar[tuple[str, ...]] = ()
    """Names of its states and outputs, beside those of every model: theta (rad), angle of phase A's internal voltage or
    of the PLL; w (rad/s), its speed relative to nominal; f (Hz), the frequency that the unit reports."""
    LIMITS_OF_P: ClassVar[tuple[str, ...]] = ("P_set_lim",)
    """Parameters between which the first P_set must be; a name that ends in "_min" is the lower bound."""
    BOUNDS_AT_REST: ClassVar[tuple[tuple[str, str, str, str], ...]] = ()
    """Checks at the start: "P", "Q" or "E" (pu), its unit, and the parameters of its lowest and highest."""

    measures_positive_sequence: ClassVar[bool] = False

    @staticmethod
    def advance(g: Any, t: Any, x0: Any, x: Any, d: Any, h: float, second: bool) -> None:
        """Make one pass; compiled.

        `g`: parameters, `UnitRating.constants`, y_f (S, filter in the network), and what `constants` adds; `t`: in:
        P_set, V_set, Q_set (pu), P, Q, V (pu: power, and mean voltage of the phases), V_A, V_B, V_C (V), I_A, I_B, I_C
        (A, out of the unit), of the last network solution; in and out: J_A, J_B, J_C (A); `x0`, `x`, `d`: states at the
        start of the step, present ones, and slopes of the first pass; `h`: length (s); `second`: whether this is the
        corrector.
        """
        raise NotImplementedError

    @staticmethod
    def rest(g: Any, x: Any, V: Any, I: Any, J: Any, S: complex, v: float) -> None:  # noqa: E741
        """Set the states at rest, as `x["q"] = S.imag`; not compiled. w is already 0, and f nominal.

        V (V), I, J (A): of three phases; S, v: power and voltage that it measures (pu).
        """
        raise NotImplementedError

    @staticmethod
    def locked(x: Any, w: float, f: float) -> None:
        """Set the states of a unit at rest that enters an island with another speed w (rad/s) and frequency f (Hz)."""

    def constants(self, rating: UnitRating) -> dict[str, float | complex | bool]:
        """Return further values for `g`; the types are the same for every unit."""
        return {}

    def values(self, rating: UnitRating, y_f: complex) -> dict[str, Any]:
        """Return all values of `g`; `y_f` is the admittance of the filter in the network (S)."""
        fields = {name: getattr(self, name) for name in self.__struct_fields__}
        given = {name: value for name, value in fields.items() if not isinstance(value, str | None)}
        numbers = {name: value if isinstance(value, bool) else float(value) for name, value in given.items()}
        return {**rating.constants(), "y_f": y_f, **numbers, **self.constants(rating)}

    def admittance(self, rating: UnitRating) -> complex:
        """Return the filter's admittance (S) between internal and terminal voltage; 0 for a current source."""
        return 1.0 / (complex(self.R_f, self.X_f) * (rating.V_b**2 / (rating.S_b / 3.0)))

    def feedback(self) -> complex | None:
        """Return d i_after / d i_before of the current over a pass at the same voltage (dq); None for a voltage.

        A model whose pass gives its internal voltage from its own current is a current source in the second-order
        method, and is solved with the network in rounds, for which this is the slope.
        """
        return None

    def volt_var_at_rest(self) -> VoltVar:
        return VoltVar()

    @property
    def current_limit(self) -> float:
        """Largest current of a phase (pu), which the plant enforces; infinite without."""
        return float(getattr(self, "I_max", inf))

    @property
    def holds_terminal(self) -> bool:
        """Whether V_set - m_q q is the terminal's voltage at rest; else the internal voltage."""
        return True

    @property
    def equal_powers(self) -> bool:
        """Whether its phases have equal powers; else equal currents, or equal internal voltages."""
        return False

    def objection(self, method: Method) -> str:
        """Return why a method of time stepping cannot step these parameters; empty if it can."""
        return ""

    def time_constants(self) -> dict[str, float]:
        """Return the time constants (s) that the step must resolve, by their parameters."""
        return {name: getattr(self, name) for name in self.__struct_fields__ if name.startswith("T_")}

    def beyond_gridlabd(self) -> dict[str, str]:
        """Return the values that GridLAB-D does not have, by their keys in a file; by default the whole model."""
        return {"model": f'"{self.model}"'}

    def response(self) -> DroopLag | FollowerLag | None:
        """Return the linear response for `predict`, or None if the model has none."""
        return None
