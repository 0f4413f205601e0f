"""Parameters of single inverters: sets by name, in which each value is a row."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gridpeers.plant.inverters.inverter_model import InverterModel, Kind
from gridpeers.plant.inverters.inverter_registry import (
    INVERTERS,
    OwnParameters,
    ParameterSet,
    chosen_own,
    foreign,
    given,
    with_published,
)
from gridpeers.plant.tables.branches import BusTable
from gridpeers.plant.tables.feeder_columns import ParameterColumns
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.schema.table_schema import Problem, contradictions, fields_of
from gridpeers.wire.wording import suggestion

FILE = "inverter_parameters.csv"


def read_parameter_sets(buses: BusTable) -> dict[str, ParameterSet] | None:
    """Read inverter_parameters.csv, or return None if it is unreadable.

    Which inverter has a set decides whether it can have its parameters: `gridpeers.plant.tables.shunts` asks.
    """
    values: dict[str, dict[str, float | bool | str]] = {}
    table = buses.table(FILE, ParameterColumns)
    for row in table:
        it = row.columns
        before = values.setdefault(it.set, {})
        if it.key in before:
            row.problem(f'set "{it.set}" has {it.key} already; give each parameter once')
            continue
        value = _value_of(it.value)
        found = read_table(OwnParameters, {it.key: value})[1] if it.key else []
        for path, text in found:
            row.problem(f'set "{it.set}": {path}: {text}')
        if it.key and not found:
            before[it.key] = value
    sets: dict[str, ParameterSet] = {}
    for name, cells in values.items():
        own = read_table(OwnParameters, cells)[0]
        sets[name] = given(own)
        found = contradictions(OwnParameters, own)
        if (model := sets[name].get("model", "gridlabd")) not in INVERTERS.names:
            del sets[name]["model"]
            found.append(Problem("model", f'there is no "{model}"; {suggestion(model, INVERTERS.names, "choices")}'))
        buses.problems += [f'{FILE}: set "{name}": {path}: {text}' for path, text in found]
    return sets if table.readable else None


def _value_of(cell: str) -> float | bool | str:
    if cell in ("true", "false"):
        return cell == "true"
    try:
        return float(cell)
    except ValueError:
        return cell


def as_set(
    name: str,
    kind: Kind,
    params: str | Mapping[str, Any] | InverterModel | None,
    sets: Mapping[str, ParameterSet],
) -> tuple[str, dict[str, ParameterSet]]:
    """Return the name of the set that an inverter's parameters are, and all sets with it.

    `name`: its name, which a new set takes; `params`: the name of a set, some parameters by their keys in a file, all
    of them, or none. ValueError with all that is wrong.
    """
    if not params:
        return "", dict(sets)
    found: list[str] = []
    if isinstance(params, str):
        all_sets = with_published(sets)
        if params not in all_sets:
            raise ValueError(f'inverter "{name}": no parameter set "{params}"; {suggestion(params, all_sets, "sets")}')
        own, label = all_sets[params], params
    else:
        if isinstance(params, Mapping):
            values = {str(key): value for key, value in params.items()}
        elif isinstance(params, InverterModel):
            every = {field.key: getattr(params, field.name) for field in fields_of(type(params))}
            values = {key: value for key, value in every.items() if value is not None}
        else:
            raise ValueError(
                f'inverter "{name}": params: must be the name of a set, keys with values such as {{"T_p_s": 0.02}}, '
                f"a model such as GfmDroop, got {params!r}"
            )
        read, noted = read_table(chosen_own(values), values)
        own, found = given(read), [f"{path}: {text}" for path, text in noted]
        label = next((known for known, other in sets.items() if other == own), name)
    found += [f"{key}: a {kind} has no such parameter" for key in foreign(own, kind)]
    if label in sets and sets[label] != own:
        found.append(f'there is another set "{label}" already; name the inverter otherwise')
    if found:
        raise ValueError(f'inverter "{name}": ' + "; ".join(found))
    return label, {**sets, label: own}
