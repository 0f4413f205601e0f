"""Parameters of inverters by kind, `inverter-models.md` sections 3 and 4, and of single inverters."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

import msgspec
from msgspec.structs import replace

from gridpeers.wire.schema.table_schema import Below, Plausible, Unit, fields_of

TimeConstant = Annotated[float, Unit("s"), Plausible("a time constant", 1e-5, 10.0, above_zero=True)]
Gain = Annotated[float, Plausible("a gain", 0.0, 1e6)]
Resistance = Annotated[float, Unit("pu"), Plausible("a filter resistance", 0.0, 1.0)]
Reactance = Annotated[float, Unit("pu"), Plausible("a filter reactance", 0.001, 1.0, above_zero=True)]
LimitOfP = Annotated[float, Unit("pu"), Plausible("a limit of P", -2.0, 3.0)]
LimitOfQ = Annotated[float, Unit("pu"), Plausible("a limit of Q", -10.0, 10.0)]
BoundOfPset = Annotated[float, Unit("pu"), Plausible("the bound of P_set", 0.1, 10.0, above_zero=True)]
BoundOfVset = Annotated[float, Unit("pu"), Plausible("a bound of V_set", 0.1, 2.0, above_zero=True)]
InternalVoltage = Annotated[float, Unit("pu"), Plausible("a limit of the internal voltage", 0.0, 2.0)]
Capacity = Annotated[float, Unit("pu"), Plausible("a limit of apparent power or current", 0.1, 5.0, above_zero=True)]
PhaseCurrent = Annotated[float, Unit("pu"), Plausible("a limit of a phase's current", 0.5, 1000.0, above_zero=True)]
VoltageBand = Annotated[float, Unit("pu"), Plausible("a dead band", 0.0, 0.2)]
FrequencyBand = Annotated[float, Unit("Hz"), Plausible("a dead band", 0.0, 5.0)]


class GfmParameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Grid-forming inverter, `inverter-models.md` section 3. Per unit of own rating."""

    model: Literal["gridlabd", "regfm_a1"] = "gridlabd"
    """Quantities that its controller measures: total power and mean voltage of the phases, as GridLAB-D, or power and
    voltage of the positive sequence, as REGFM_A1 (section 3.8)."""
    voltage_control: bool = True
    """true: the Q-V droop gives the terminal voltage, and a controller holds it; false: the droop gives the internal
    voltage (VFlag of REGFM_A1, section 3.8)."""
    R_f: Annotated[Resistance, "Filter resistance (pu)."] = 0.015
    X_f: Annotated[Reactance, "Filter reactance (pu)."] = 0.15
    T_p: Annotated[TimeConstant, "Filter of measured P (s)."] = 0.01
    T_q: Annotated[TimeConstant, "Filter of measured Q (s)."] = 0.01
    T_v: Annotated[TimeConstant, "Filter of measured V (s)."] = 0.01
    P_max: Annotated[LimitOfP, "Overload limit (pu)."] = 1.0
    P_min: Annotated[LimitOfP, Below("P_max"), "Under-load limit (pu)."] = 0.0
    k_pp: Annotated[Gain, Unit("rad/s per pu"), "Proportional gain of the P limiters (rad/s per pu)."] = 3.0
    k_ip: Annotated[Gain, Unit("rad/s^2 per pu"), "Integral gain of the P limiters (rad/s^2 per pu)."] = 60.0
    w_lim: Annotated[float, Unit("rad/s"), Plausible("the limiters' bound w_lim", 0.1, 1e4, above_zero=True)] = 200.0
    """Bound of the P limiters' output (rad/s)."""
    Q_max: Annotated[LimitOfQ, "Upper reactive limit (pu)."] = 10.0
    Q_min: Annotated[LimitOfQ, Below("Q_max"), "Lower reactive limit (pu)."] = -10.0
    k_pq: Annotated[Gain, Unit("pu V per pu"), "Proportional gain of the Q limiters (pu V per pu)."] = 3.0
    k_iq: Annotated[Gain, Unit("pu V per pu s"), "Integral gain of the Q limiters (pu V per pu s)."] = 20.0
    V_lim: Annotated[float, Unit("pu"), Plausible("the limiters' bound V_lim", 0.01, 10.0, above_zero=True)] = 10.0
    """Bound of the Q limiters' output (pu V)."""
    k_pv: Annotated[Gain, "Proportional gain of the voltage controller."] = 0.0
    k_iv: Annotated[Gain, Unit("1/s"), "Integral gain of the voltage controller (1/s)."] = 5.86
    E_min: Annotated[InternalVoltage, Below("E_max"), "Lower bound of the internal voltage (pu)."] = 0.0
    E_max: Annotated[InternalVoltage, "Upper bound of the internal voltage (pu)."] = 1.25
    I_max: PhaseCurrent = 2.0
    """Largest current of a phase (pu of the rating): beyond it the phase keeps its angle and loses the surplus."""
    P_set_lim: BoundOfPset = 3.0
    """Bound of P_set, either way (pu). P_set shifts the droop (3), so it may exceed P_max; with 3 pu and 1 % droop an
    unloaded GFM stays within 3 % of nominal frequency. GridLAB-D has no such bound."""
    V_set_min: Annotated[BoundOfVset, Below("V_set_max"), "Lower bound of V_set (pu)."] = 0.8
    V_set_max: Annotated[BoundOfVset, "Upper bound of V_set (pu)."] = 1.2


REGFM_A1 = GfmParameters(
    model="regfm_a1",
    R_f=0.0,
    X_f=0.15,
    P_max=0.9,
    k_pp=0.01 * 2.0 * pi * 60.0,
    k_ip=0.1 * 2.0 * pi * 60.0,
    Q_max=0.44,
    Q_min=-0.44,
    E_max=1.15,
)
"""Default values of public implementations of REGFM_A1, at 60 Hz (section 3.8); VFlag is 1."""

REGFM_A1_VFLAG0 = replace(REGFM_A1, voltage_control=False, k_pq=0.1, k_iq=10.0)
"""The same with VFlag 0, which has other gains of the Q limiters."""


class GflParameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Grid-following inverter, `inverter-models.md` section 4. Per unit of own rating."""

    model: Literal["voltage_source", "current_source"] = "voltage_source"
    """Representation towards the network (sections 4.6, 4.7)."""
    mode: Literal["positive_sequence", "balanced_power"] = "positive_sequence"
    """Control of its phases: one PLL for all and equal currents, or a PLL for each and equal powers (section 4)."""
    R_f: Annotated[Resistance, "Filter resistance (pu)."] = 0.01
    X_f: Annotated[Reactance, "Filter reactance (pu)."] = 0.15
    k_pPLL: Annotated[Gain, Unit("rad/s per pu"), "PLL proportional gain (rad/s per pu)."] = 50.0
    k_iPLL: Annotated[Gain, Unit("rad/s^2 per pu"), "PLL integral gain (rad/s^2 per pu)."] = 900.0
    k_pc: Annotated[Gain, Unit("pu", in_key=False), "Current controller, proportional (pu)."] = 0.05
    k_ic: Annotated[Gain, Unit("1/s"), "Current controller, integral (1/s)."] = 5.0
    F_current: Annotated[float, Plausible("the cross-coupling gain F_current", 0.0, 1.0)] = 0.6
    """Cross-coupling gain: 0 oscillates on this feeder, 1 diverges (row 23)."""
    T_if: Annotated[TimeConstant, "Current lag of the current-source form (s)."] = 0.005
    frequency_watt: Annotated[bool, "Frequency-watt droop on."] = True
    volt_var: Annotated[bool, "Volt-var droop on."] = True
    T_ff: Annotated[TimeConstant, "Filter of the PLL frequency (s)."] = 0.02
    T_pf: TimeConstant = 0.05
    """Lag of the P reference (s). GridLAB-D's default 0.5 s is too slow for consensus in 1 s."""
    T_vf: Annotated[TimeConstant, "Filter of measured V (s)."] = 0.05
    T_qf: TimeConstant = 0.1
    """Lag of the Q reference (s). 5 % droop is a gain of 20 from V to Q: with T_vf 0.02 and T_qf 0.05 s one GFM with
    four GFL oscillates on this feeder; GridLAB-D's 0.2 s only slows the sharing of vars."""
    db_UF: Annotated[FrequencyBand, "Dead band below nominal frequency (Hz)."] = 0.0
    db_OF: Annotated[FrequencyBand, "Dead band above nominal frequency (Hz)."] = 0.0
    db_UV: Annotated[VoltageBand, "Dead band below V_set (pu)."] = 0.0
    db_OV: Annotated[VoltageBand, "Dead band above V_set (pu)."] = 0.0
    dead_band: Literal["gridlabd", "ieee1547"] = "gridlabd"
    """Droop outside of a dead band, of freq-watt and volt-var: by the full deviation, so that it jumps at the edge, as
    GridLAB-D, or by the deviation from the edge, as IEEE 1547-2018 (sections 4.3, 4.4)."""
    P_max: Annotated[LimitOfP, "Upper bound of the P reference (pu)."] = 1.0
    P_min: Annotated[LimitOfP, Below("P_max"), "Lower bound of the P reference (pu)."] = -1.0
    S_max: Annotated[Capacity, "Apparent-power limit (pu of the rating): bounds Q at sqrt(S_max^2 - P^2)."] = 1.2
    Q_max: Annotated[LimitOfQ, "Upper bound of the Q reference (pu): Q1 of IEEE 1547-2018."] = 10.0
    Q_min: Annotated[LimitOfQ, Below("Q_max"), "Lower bound of the Q reference (pu): Q4 of IEEE 1547-2018."] = -10.0
    i_max: Annotated[Capacity, "Bound of each axis of the current reference (pu)."] = 1.2
    P_set_lim: BoundOfPset = 1.0
    """Bound of P_set, either way (pu), before the droop (7) is added: the rating, as in GridLAB-D. A larger one lets a
    set-point that was wound up delay the inverter's response."""
    V_set_min: Annotated[BoundOfVset, Below("V_set_max"), "Lower bound of V_set (pu)."] = 0.8
    V_set_max: Annotated[BoundOfVset, "Upper bound of V_set (pu)."] = 1.2


Kind = Literal["GFM", "GFL"]

InverterParameters = GfmParameters | GflParameters

PARAMETERS_OF: dict[str, type[GfmParameters] | type[GflParameters]] = {"GFM": GfmParameters, "GFL": GflParameters}


def _either(first: Any, second: Any) -> Any:
    if get_origin(first) is get_origin(second) is Literal:
        return Literal[(*get_args(first), *get_args(second))]
    return first | second


def _optional_fields() -> list[tuple[str, Any, None]]:
    """Return the fields of both kinds, each with its unit and range, and None where it gives nothing."""
    types: dict[str, Any] = {}
    for cls in PARAMETERS_OF.values():
        for field in fields_of(cls):
            kind = types.get(field.name, (None, ()))[0]
            types[field.name] = field.type if kind is None else _either(kind, field.type), field.marks
    return [
        (name, Annotated[(kind | None, *marks)] if marks else kind | None, None)
        for name, (kind, marks) in types.items()
    ]


if TYPE_CHECKING:

    class OwnParameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
        """Some parameters of an inverter of either kind; None gives nothing."""

        def __init__(self, **given: Any) -> None: ...

else:
    OwnParameters = msgspec.defstruct(
        "OwnParameters",
        _optional_fields(),
        frozen=True,
        forbid_unknown_fields=True,
        kw_only=True,
        omit_defaults=True,
        module=__name__,
    )
    OwnParameters.__doc__ = "Some parameters of an inverter of either kind; None gives nothing."


BOUNDS_OF_SET_POINTS = frozenset({"P_set_lim", "V_set_min", "V_set_max"})  # of ours alone, not of a published model


def _published(own: InverterParameters) -> OwnParameters:
    names = [name for name in own.__struct_fields__ if name not in BOUNDS_OF_SET_POINTS]
    return OwnParameters(**{name: getattr(own, name) for name in names})


PUBLISHED_SETS = {"regfm_a1": _published(REGFM_A1), "regfm_a1_vflag0": _published(REGFM_A1_VFLAG0)}


def with_published(sets: Mapping[str, OwnParameters]) -> dict[str, OwnParameters]:
    """Return the sets of a feeder, which come first, and the published ones."""
    return {**sets, **{name: own for name, own in PUBLISHED_SETS.items() if name not in sets}}


def given(own: OwnParameters) -> dict[str, Any]:
    """Return what a set gives, by the names of `GfmParameters` and `GflParameters`."""
    values = {name: getattr(own, name) for name in own.__struct_fields__}
    return {name: value for name, value in values.items() if value is not None}


def foreign(own: OwnParameters, kind: str) -> list[str]:
    """Return what a set gives and a kind does not have: keys, and words of a choice with their key.

    >>> foreign(OwnParameters(P_max=1.2, S_max=1.2), "GFM"), foreign(OwnParameters(model="regfm_a1"), "GFL")
    (['S_max_pu'], ['model = "regfm_a1"'])
    """
    values, found = given(own), []
    fields = {field.name: field for field in fields_of(PARAMETERS_OF[kind])}
    for field in fields_of(OwnParameters):
        if field.name not in values:
            continue
        if field.name not in fields:
            found.append(field.key)
            continue
        kept = fields[field.name].type
        if get_origin(kept) is Literal and values[field.name] not in get_args(kept):
            found.append(f'{field.key} = "{values[field.name]}"')
    return found
