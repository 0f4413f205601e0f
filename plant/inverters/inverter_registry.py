"""The registry of inverter models: what a scenario may name in `model`, and how a unit gets its parameters."""

from __future__ import annotations

from cmath import isfinite
from collections.abc import Mapping
from copy import copy
from dis import get_instructions
from functools import cache
from inspect import getattr_static
from types import SimpleNamespace
from typing import Annotated, Any

import msgspec

from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.inverter_model import DroopLag, FollowerLag, InverterModel, Kind, UnitRating
from gridpeers.plant.inverters.regfm_a1 import REGFM_A1, REGFM_A1_VFLAG0
from gridpeers.plant.inverters.vsm import Vsm
from gridpeers.wire.plugins.plugin import parameter_objection
from gridpeers.wire.plugins.registry import ANYTHING, Registry, line_of, named
from gridpeers.wire.schema.table_schema import Field, fields_of
from gridpeers.wire.wording import suggestion

OURS: dict[Kind, tuple[type[InverterModel], ...]] = {"GFM": (GfmDroop, type(REGFM_A1), Vsm), "GFL": (Gfl,)}
"""Models that come with gridpeers; the first of a kind is its default."""


@cache
def _trial(model: type[InverterModel]) -> str:
    """Return why a model fails as functions of Python, "" if it does not: the compiler would say less."""
    names = ("theta", "w", "f", *model.STATES)
    x = SimpleNamespace(**dict.fromkeys(names, 0.0))
    numbers = {"P_set": 0.5, "V_set": 1.0, "Q_set": 0.0, "P": 0.5, "Q": 0.1, "V": 1.0}
    t = SimpleNamespace(**numbers, **{f"{quantity}_{phase}": 200.0 + 0j for quantity in "VIJ" for phase in "ABC"})
    it, rating, failing = model(), UnitRating(1e5, 277.0, 0.01, 0.05, 60.0), "admittance"
    try:
        if not isfinite(y_f := it.admittance(rating)):
            return f"its admittance is {y_f}; it must be a finite number (S)"
        failing = "response"
        found, usable = it.response(), {"GFM": DroopLag, "GFL": FollowerLag}[it.kind]
        if found is not None and not (isinstance(found, usable) and all(value >= 0.0 for value in found)):
            return f"its response is {found!r:.80}; it must be None, or a {usable.__name__} without negative values"
        failing = "constants"
        g = SimpleNamespace(**it.values(rating, y_f))
        failing = "advance"
        for second in (False, True):
            model.advance(g, t, copy(x), x, copy(x), 0.002, second)
    except ANYTHING as error:
        return f"its method {failing} fails{line_of(getattr(model, failing), error)}: {named(error)}"
    unknown = ", ".join(sorted(set(vars(x)) - set(names)))
    return f"its pass sets {unknown}, which its STATES do not name" if unknown else ""


def _objection(it: Any) -> str:
    if not (isinstance(it, type) and issubclass(it, InverterModel)):
        return "derive a class from gridpeers.InverterModel"
    own = {name: getattr_static(it, name) for name in ("advance", "rest")}
    if missing := [
        name
        for name, found in own.items()
        if not isinstance(found, staticmethod) or found is getattr_static(InverterModel, name)
    ]:
        return f"it has no static method {missing[0]}; docs/how-to/plug-ins.md has the contract"
    if it.kind not in OURS:
        return f'its kind must be "GFM" or "GFL", got {it.kind!r}'
    if not isinstance(it.STATES, tuple) or len({*it.STATES, "theta", "w", "f"}) < len(it.STATES) + 3:
        return f"its STATES must be a tuple of names, each one once and beside theta, w and f, got {it.STATES!r}"
    if any(step.opname == "RAISE_VARARGS" for step in get_instructions(it.advance)):
        return "its pass raises an error, which compiled code passes over; let it bound its values instead"
    try:
        it()
    except ANYTHING as error:
        return f"give every parameter a default: {named(error)}"
    return parameter_objection(it) or _trial(it)


INVERTERS: Registry[type[InverterModel]] = Registry(
    "inverter model",
    "inverters",
    _objection,
    own={
        "gridlabd": "gridpeers.plant.inverters.gfm_droop:GfmDroop",
        "regfm_a1": "gridpeers.plant.inverters.regfm_a1:RegfmA1",
        "vsm": "gridpeers.plant.inverters.vsm:Vsm",
        "voltage_source": "gridpeers.plant.inverters.gfl:Gfl",
        "current_source": "gridpeers.plant.inverters.gfl:Gfl",
    },
)


def model_of(values: Mapping[str, Any], kind: Kind = "GFM") -> InverterModel:
    """Return a model with parameters by name; `values` names it, else it is the default of the kind."""
    return msgspec.convert(dict(values), _class_of(values, kind))


def _class_of(values: Mapping[str, Any], kind: Kind) -> type[InverterModel]:
    name = values.get("model")
    return INVERTERS.resolve(str(name), str(values.get("folder") or "")) if name else OURS[kind][0]


def chosen(kind: Kind, table: Mapping[str, Any]) -> type[InverterModel]:
    """Return the model that a table of a kind names; ValueError if there is none, or it is of the other kind."""
    name = table.get("model")
    if not isinstance(name, str):
        return OURS[kind][0]
    if ":" not in name and name not in INVERTERS.names:
        known = [known for known in INVERTERS.names if INVERTERS.resolve(known).kind == kind]
        raise ValueError(f'there is no "{name}"; {suggestion(name, known, "choices")}')
    if (model := _class_of(table, kind)).kind != kind:
        raise ValueError(f'"{name}" is a model of a {model.kind}, and this is a {kind}; name another one')
    return model


def with_own(common: InverterModel, own: Mapping[str, Any]) -> InverterModel:
    """Return the model of a unit: its own parameters before those that its kind has in common.

    To another model than the common one goes only what that gives beside its defaults.
    """
    model = _class_of(own, common.kind) if own.get("model") else type(common)
    base = msgspec.structs.asdict(common)
    if model is not type(common):
        default = type(common)()
        base = {name: value for name, value in base.items() if name != "model" and value != getattr(default, name)}
    # what its model has not, the checks of feeder and scenario refuse; others of their checks come first
    return model(**{name: value for name, value in {**base, **own}.items() if name in model.__struct_fields__})


# ------------------------------------------------------ sets of parameters, and parameters of single inverters


def own_parameters(values: Mapping[str, Any]) -> msgspec.Struct:
    """Return the parameters of a single inverter from what it gives, in any process: its model may bring others."""
    made: msgspec.Struct = chosen_own(values)(**values)
    return made


def _made_again(own: msgspec.Struct) -> tuple[Any, ...]:
    return own_parameters, (given(own),)


@cache
def optional(*models: type[InverterModel]) -> type[msgspec.Struct]:
    """Return a struct of the parameters of some models, each with its unit and range, and None where it gives none."""
    fields: dict[str, Field] = {}
    for field in (field for model in models for field in fields_of(model)):
        fields.setdefault(field.name, field)
    types = {
        name: Annotated[field.type | None, *field.marks] if field.marks else field.type | None
        for name, field in fields.items()
    }
    rules: Any = {"frozen": True, "forbid_unknown_fields": True, "kw_only": True, "omit_defaults": True}
    words = {"__doc__": "Some parameters of an inverter; None gives nothing.", "__reduce__": _made_again}
    return msgspec.defstruct(
        "OwnParameters", [(name, it, None) for name, it in types.items()], **rules, module=__name__, namespace=words
    )


OwnParameters: Any = optional(*OURS["GFM"], *OURS["GFL"])  # Some parameters of an inverter of any of our models


def chosen_own(table: Mapping[str, Any]) -> Any:
    """Return the parameters that the table of a single inverter may give: those of its model, if it is none of ours."""
    name = table.get("model")
    if not isinstance(name, str) or name in INVERTERS.own:
        return OwnParameters
    return optional(_class_of(table, "GFM"))


def given(own: msgspec.Struct) -> dict[str, Any]:
    """Return what a set gives, by the names of the parameters."""
    return {name: value for name, value in msgspec.structs.asdict(own).items() if value is not None}


BOUNDS_OF_SET_POINTS = frozenset({"P_set_lim", "V_set_min", "V_set_max"})  # of ours alone, not of a published model


ParameterSet = dict[str, Any]  # Parameters by name

PUBLISHED_SETS: dict[str, ParameterSet] = {
    name: {key: value for key, value in given(own).items() if key not in BOUNDS_OF_SET_POINTS}
    for name, own in (("regfm_a1", REGFM_A1), ("regfm_a1_vflag0", REGFM_A1_VFLAG0))
}


def foreign(own: Mapping[str, Any], kind: Kind, model: type[InverterModel] | None = None) -> list[str]:
    """Return what a set gives and a kind, or one model, has not: keys, and words of a choice with their key.

    >>> foreign({"P_max": 1.2, "S_max": 1.2}, "GFM"), foreign({"model": "regfm_a1"}, "GFL")
    (['S_max_pu'], ['model = "regfm_a1"'])
    """
    found, models = [], (model,) if model else OURS[kind]
    if "model" in own and (named_model := _class_of(own, kind)).kind == kind:
        models = (named_model,)
    elif "model" in own:
        found.append(f'model = "{own["model"]}"')
    known = {field.name for it in models for field in fields_of(it)}
    keys = {field.name: field.key for field in fields_of(chosen_own(own))}
    return found + [keys.get(name, name) for name in own if name not in known]
