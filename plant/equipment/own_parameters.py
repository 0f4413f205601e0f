"""Parameters of a single inverter, or of a set that several share: what they give replaces their kind's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

import msgspec

from gridpeers.plant.equipment.inverter_parameters import REGFM_A1, REGFM_A1_VFLAG0, GflParameters, GfmParameters
from gridpeers.wire.schema.table_schema import fields_of

Kind = Literal["GFM", "GFL"]
"""Grid-forming or grid-following."""

InverterParameters = GfmParameters | GflParameters
"""All parameters of one inverter."""

PARAMETERS_OF: dict[str, type[GfmParameters] | type[GflParameters]] = {"GFM": GfmParameters, "GFL": GflParameters}
"""Parameters by kind of inverter."""


def _either(first: Any, second: Any) -> Any:
    """Return the type of a key that both kinds have: a choice takes the words of both, `foreign` knows whose."""
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


BOUNDS_OF_SET_POINTS = frozenset({"P_set_lim", "V_set_min", "V_set_max"})
"""Parameters of ours alone: neither a published model nor GridLAB-D's inverter has them."""


def _published(own: InverterParameters) -> OwnParameters:
    """Return a set of all parameters that a specification has."""
    names = [name for name in own.__struct_fields__ if name not in BOUNDS_OF_SET_POINTS]
    return OwnParameters(**{name: getattr(own, name) for name in names})


PUBLISHED_SETS = {"regfm_a1": _published(REGFM_A1), "regfm_a1_vflag0": _published(REGFM_A1_VFLAG0)}
"""Sets of published values, which every feeder has."""


def with_published(sets: Mapping[str, OwnParameters]) -> dict[str, OwnParameters]:
    """Return the sets of a feeder, which come first, and the published ones."""
    return {**sets, **{name: own for name, own in PUBLISHED_SETS.items() if name not in sets}}


def given(own: OwnParameters) -> dict[str, Any]:
    """Return what a set gives, by the names of `GfmParameters` and `GflParameters`.

    Examples
    --------
    >>> given(OwnParameters(P_max=1.2))
    {'P_max': 1.2}
    """
    values = {name: getattr(own, name) for name in own.__struct_fields__}
    return {name: value for name, value in values.items() if value is not None}


def foreign(own: OwnParameters, kind: str) -> list[str]:
    """Return what a set gives and a kind of inverter does not have: keys, and words of a choice with their key.

    Examples
    --------
    >>> foreign(OwnParameters(P_max=1.2, S_max=1.2), "GFM")
    ['S_max_pu']
    >>> foreign(OwnParameters(model="regfm_a1"), "GFL")
    ['model = "regfm_a1"']
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
