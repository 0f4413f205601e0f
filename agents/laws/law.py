"""The contract of a control law: one object per inverter, called once a control period, in per unit. Pure.

A law uses no clock, file, randomness or network: the same calls give the same results in one process and in many. The
agent does not call it while the inverter is grid-connected, out of service or without a fresh measurement. After such a
pause it calls `start` first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, NamedTuple

from gridpeers.wire.schema.table_reading import parameter_values
from gridpeers.wire.schema.table_schema import Below, Range, Unit

NOTHING_SHARED: Mapping[str, float] = MappingProxyType({})  # Default of `shared`: no value


class Own(NamedTuple):
    """Own inverter, as a law sees it. Per unit: powers of P_rated, voltages of V_nom, frequencies of f_nom."""

    name: str
    """Name of the inverter."""
    leader: bool
    """Whether it is grid-forming (g_i = 1 in the paper's equations (12)-(15))."""
    t: float
    """Run time of the measurement (s)."""
    P: float
    """Measured real power (pu)."""
    Q: float
    """Measured reactive power (pu)."""
    V: float
    """Measured terminal voltage (pu)."""
    e: float
    """Measured frequency error (f - f_nom)/f_nom (pu)."""
    z: float
    """m_q times the measured reactive power, as in (14) and (15) (pu)."""
    P_set: float
    """Set-point of real power (pu): the last decision; at `start`, the set-point that the plant holds."""
    V_set: float
    """Set-point of voltage (pu), likewise."""
    m_p: float
    """P-f droop (pu frequency per pu power)."""
    m_q: float
    """Q-V droop (pu voltage per pu reactive power)."""
    P_rated: float
    """Rating (W)."""
    V_nom: float
    """Nominal line-to-neutral voltage (V)."""
    f_nom: float
    """Nominal frequency (Hz)."""
    P_saturated: int = 0
    """1: it delivers less than P_set and cannot deliver more; -1: more, and cannot deliver less; else 0."""
    V_saturated: int = 0
    """The same for V_set."""


class Neighbour(NamedTuple):
    """Last state of a neighbour, as a law sees it. Per unit of the neighbour's own rating."""

    name: str
    """Name of the inverter."""
    leader: bool
    """Whether it is grid-forming."""
    age: float
    """Age of the state (s of run time)."""
    weight: float
    """Weight from 0 to 1 of a state of that age, by `[degraded_communication]`; 1 by default."""
    P_set: float
    """Its set-point of real power (pu)."""
    V_set: float
    """Its set-point of voltage (pu)."""
    Q: float
    """Its measured reactive power (pu)."""
    m_p: float
    """Its P-f droop (pu)."""
    m_q: float
    """Its Q-V droop (pu)."""
    P_rated: float
    """Its rating (W)."""
    shared: Mapping[str, float] = NOTHING_SHARED
    """Shared variables of its law, by name."""


class Term(NamedTuple):
    """One part of the change of a set-point."""

    name: str
    """One or two words, such as "frequency error"."""
    value: float
    """Part of the change (pu)."""
    neighbour: str = ""
    """Neighbour whose state causes it; empty for the own inverter."""


class Terms(NamedTuple):
    """A decision as the terms of its change, before the limits."""

    P_set: Sequence[Term] = ()
    """Terms that add up to the change of P_set (pu of own rating)."""
    V_set: Sequence[Term] = ()
    """Terms that add up to the change of V_set (pu of own nominal)."""
    shared: Mapping[str, float] = NOTHING_SHARED
    """As in `SetPoints`."""
    send: bool = True
    """As in `SetPoints`."""


class SetPoints(NamedTuple):
    """A decision: the set-points of the next control period, and the message to the neighbours."""

    P_set: float
    """Set-point of real power (pu of own rating); the agent limits it to P_set_min, P_set_max."""
    V_set: float
    """Set-point of voltage (pu of own nominal); the agent limits it to V_set_min, V_set_max."""
    shared: Mapping[str, float] = NOTHING_SHARED
    """Shared variables for the neighbours: at most 16, with names of letters, digits and "_"."""
    send: bool = True
    """Whether the neighbours get this state; otherwise they keep the last one."""
    terms: Callable[[], Terms] | None = None
    """Function that splits this change into terms; only `gridpeers why` calls it."""


class Law:
    """Base of all laws: derive from it, annotate the parameters, and write `step` (docs/how-to/plug-ins.md).

    A wrong, unknown or missing parameter raises ValueError.
    """

    source: ClassVar[str] = ""
    """Publication of the law."""

    P_set_min: Annotated[
        float, Unit("pu"), Range(-100, 100), Below("P_set_max", or_equal=True), "Lower limit of P_set."
    ] = 0.0
    P_set_max: Annotated[float, Unit("pu"), Range(-100, 100), "Upper limit of P_set."] = 1.0
    V_set_min: Annotated[
        float, Unit("pu"), Range(0, 10), Below("V_set_max", or_equal=True), "Lower limit of V_set."
    ] = 0.9
    V_set_max: Annotated[float, Unit("pu"), Range(0, 10), "Upper limit of V_set."] = 1.1

    def __init__(self, **parameters: Any) -> None:
        for name, value in parameter_values(type(self), parameters).items():
            setattr(self, name, value)

    def start(self, own: Own) -> None:
        """Clear the memory, and start from the set-points that the plant holds, `own.P_set` and `own.V_set`."""

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints | Terms:
        """Return the set-points of the next control period T (s), or the terms of their change.

        `neighbours` are those whose states count, in the order of the inverters. The agent adds up terms, and
        `gridpeers why` shows them; set-points without terms are one term.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Release the files and processes of the law, at the end of the run."""


LIMITS = ("P_set_min", "P_set_max", "V_set_min", "V_set_max")
"""Parameters of every law under every carrier: the agent limits the result of `step` to them."""


def limits_in(parameters: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in parameters.items() if name in LIMITS}
