"""The contract of a control law: one object per inverter, called once a control period, in per unit. Pure.

A law sees its own inverter (`Own`) and its neighbours' last states (`Neighbour`), and returns the set-points of the
next period (`SetPoints`), or the terms of their change (`Terms`). Its only memory is its own attributes. It uses no
clock, file, randomness or network: the same calls give the same results in one process and in many.

The agent of a law decides when to call it: not while the inverter is grid-connected or out of service,
nor without a fresh measurement. After such a pause it calls `start` first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, NamedTuple

from gridpeers.wire.schema.table_reading import parameter_values
from gridpeers.wire.schema.table_schema import Below, Range, Unit

NOTHING_SHARED: Mapping[str, float] = MappingProxyType({})
"""Default of `shared`: no further values."""


class Own(NamedTuple):
    """Own inverter, as a law sees it. Per unit: powers of P_rated, voltages of V_nom, frequencies of f_nom."""

    name: str
    """Name of the inverter."""
    leader: bool
    """Whether it is grid-forming: g_i = 1 in (12)-(15)."""
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
    """m_q q, q measured, as in (14) and (15) (pu)."""
    P_set: float
    """Own set-point of real power (pu): the law's last result, or the plant's set-point at `start`."""
    V_set: float
    """Own set-point of voltage (pu)."""
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
    """1 if the inverter delivers less than P_set and cannot deliver more, -1 if more and not less, else 0."""
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
    """Weight from 0 to 1 that the agent gives the state for its age; see `[degraded_communication]`."""
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
    """Further values that its law shares."""


class Term(NamedTuple):
    name: str
    """A word or two, such as "frequency error"."""
    value: float
    """Its part of the step (pu)."""
    neighbour: str = ""
    """Name of the neighbour whose state it comes from; empty if it comes from the own inverter."""


class Terms(NamedTuple):
    """A decision in terms, before its limits: each tuple adds up to the change of a set-point."""

    P_set: Sequence[Term] = ()
    """Terms of the change of P_set (pu of own rating)."""
    V_set: Sequence[Term] = ()
    """Terms of the change of V_set (pu of own nominal)."""
    shared: Mapping[str, float] = NOTHING_SHARED
    """As in `SetPoints`."""
    send: bool = True
    """As in `SetPoints`."""


class SetPoints(NamedTuple):
    P_set: float
    """Set-point of real power (pu of own rating); the agent limits it to P_set_min, P_set_max."""
    V_set: float
    """Set-point of voltage (pu of own nominal); the agent limits it to V_set_min, V_set_max."""
    shared: Mapping[str, float] = NOTHING_SHARED
    """Further values for the neighbours, at most 16, each by a name of letters, digits and "_"."""
    send: bool = True
    """Whether the neighbours get the state. If not, they keep the last one that they heard."""
    terms: Callable[[], Terms] | None = None
    """Splits this change into its terms, for a law too fast to do so in each period; only `gridpeers why` calls it."""


class Law:
    """Base of all laws: derive from it, annotate the parameters, and write `step` (docs/how-to/plug-ins.md).

    A wrong, unknown or missing parameter raises ValueError.
    """

    source: ClassVar[str] = ""
    """Publication that the law is from."""

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
        """Start, or restart, from the set-points that the plant holds, and clear the law's memory."""

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints | Terms:
        """Decide the set-points of one control period T (s), as such or as the terms of their change.

        The neighbours are those whose states count, in the order of the inverters. An agent adds up the terms, and
        `gridpeers why` shows them; a decision without terms is one term.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Release whatever the law has opened."""


LIMITS = ("P_set_min", "P_set_max", "V_set_min", "V_set_max")
"""Parameters of every law under every carrier: the agent limits the result of `step` to them."""


def limits_in(parameters: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in parameters.items() if name in LIMITS}
