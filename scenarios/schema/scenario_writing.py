"""A scenario as TOML with every key spelled out: what a run leaves in its folder."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from netem.schema.netem import Netem
from scenarios.schema.scenario_model import AS_RUN, ScenarioModel
from wire.table_schema import INHERITED, fields_of


def to_toml(scenario: ScenarioModel, as_run: Mapping[str, Any]) -> str:
    """Every key of a scenario, defaults included, and a table about the run.

    Defaults are written out because they may differ in a later version; the text can be run again as it is, and the
    table `[as_run]` is read over then.

    Parameters
    ----------
    scenario : ScenarioModel
        As run, so with the seed and the cases of the command line.
    as_run : Mapping[str, Any]
        Driver, versions and the like.
    """
    lines = [
        "# The scenario as run, every default spelled out. `gridpeers run` takes this file as it is.",
        *_table(scenario, "", scenario),
        "",
        f"[{AS_RUN}]",
        *(f"{key} = {_value(value)}" for key, value in as_run.items()),
    ]
    return "\n".join(lines) + "\n"


def _table(struct: msgspec.Struct, path: str, common: ScenarioModel) -> Iterator[str]:
    """Keys of one table, then the tables below it, as TOML wants them ordered; no case repeats a common table."""
    below: list[str] = []
    for field in fields_of(type(struct)):
        value, key = getattr(struct, field.name), field.key
        where = f"{path}.{_key(key)}" if path else _key(key)
        if INHERITED in field.marks and value == getattr(common, field.name):
            continue
        if isinstance(value, Netem):
            for entries, items in msgspec.to_builtins(value).items():
                for item in items if isinstance(items, tuple | list) else ():
                    below += ["", f"[[{path}.{entries}]]" if path else f"[[{entries}]]"]
                    own = {one["use"]: dict(one.get("parameters", ())) | _folder(one) for one in item.pop("own", ())}
                    below += [f"{_key(name)} = {_inline(given)}" for name, given in (item | own).items()]
            continue
        if isinstance(value, msgspec.Struct):
            below += ["", f"[{where}]", *_table(value, where, common)]
        elif isinstance(value, tuple) and value and isinstance(value[0], msgspec.Struct):
            for item in value:
                below += ["", f"[[{where}]]", *_table(item, where, common)]
        elif isinstance(value, dict) and any(isinstance(item, msgspec.Struct) for item in value.values()):
            for name, item in value.items():
                below += ["", f"[{where}.{_key(name)}]", *_table(item, f"{where}.{_key(name)}", common)]
        elif value is not None and (value or not isinstance(value, tuple | dict)):
            yield f"{key} = {_inline(value)}"
    yield from below


def _folder(plugin: dict[str, Any]) -> dict[str, str]:
    return {"folder": plugin["folder"]} if plugin.get("folder") else {}


def _key(name: str) -> str:
    bare = name.replace("_", "").replace("-", "")
    return name if bare.isascii() and bare.isalnum() else _value(name)


def _inline(value: Any) -> str:
    """Write a value that may be a table or a list of them on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_inline(below)}" for key, below in value.items()) + " }"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return _value(value)


def _value(value: Any) -> str:
    """Write one value; JSON's strings, numbers, lists and booleans are TOML's too, but for one character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
