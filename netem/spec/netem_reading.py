"""From the parsed TOML of `[[link]]`, `[[partition]]` and `[[node]]` to `Netem`, noting every mistake and going on."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Literal, get_args, get_origin

import msgspec

from netem.models.delay import AnyDelay
from netem.models.loss import AnyLoss
from netem.models.own_fault import FAULTS
from netem.netem_errors import Mistake, shown
from netem.plausible_links import number_in
from netem.spec.fault import Fault
from netem.spec.netem import Netem
from netem.spec.node_fault import NodeFault
from netem.spec.partition import Partition
from wire.path_text import is_no_path
from wire.plugin import Plugin, plugin_of, scalar_objection
from wire.suggestion import suggestion

ENTRIES: dict[str, type[msgspec.Struct]] = {"link": Fault, "partition": Partition, "node": NodeFault}
"""The keys of a scenario file that are netem's, and what each entry of them is."""

_FIELDS = {"link": "links", "partition": "partitions", "node": "nodes"}
_NEEDED = {Fault: "on", NodeFault: "name"}
_WHERE = re.compile(r" - at `\$(?:\.\.\.)?(.*)`$")
_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "a text in quotes",
    "bool": "true or false",
    "array": "a list",
}


def read_netem(tables: Mapping[str, Any], seed: int) -> tuple[Netem, list[Mistake]]:
    """Netem's part of a scenario file, with every mistake of its form; `Netem.mistakes` then has those of its sense.

    Parameters
    ----------
    tables : Mapping[str, Any]
        The parsed file; keys other than those of `ENTRIES` are left alone.
    seed : int
        The scenario's.

    Returns
    -------
    tuple[Netem, list[Mistake]]
        An entry that is no table, or whose links or agent are missing, is left out; a key with a mistake is too.

    Examples
    --------
    >>> netem, mistakes = read_netem({"link": [{"on": "* <-> *", "delay": "20 ms", "los": 0.1}]}, seed=1)
    >>> for path, text in mistakes:  # doctest: +ELLIPSIS
    ...     print(f"{path}: {text}")
    link[0].los: unknown key; did you mean "loss"? The keys are on, from_s, to_s, profile, delay, loss, duplicate, ...
    link[0].delay: must be a number or a table with a model, got "20 ms"; write 0.02
    """
    found: list[Mistake] = []
    fields: dict[str, Any] = {}
    for key, kind in ENTRIES.items():
        raw = tables.get(key, [])
        if not isinstance(raw, list):
            found.append(Mistake(key, f"must be written as [[{key}]], got {shown(raw)}"))
            continue
        entries = [_entry(kind, item, f"{key}[{i}]", found) for i, item in enumerate(raw)]
        fields[_FIELDS[key]] = tuple(entry for entry in entries if entry is not None)
    return Netem(seed=seed, **fields), found


def _entry(kind: type[msgspec.Struct], raw: Any, path: str, found: list[Mistake]) -> msgspec.Struct | None:
    known = {field.encode_name: field for field in msgspec.structs.fields(kind) if field.name != "own"}
    if not isinstance(raw, Mapping):
        found.append(Mistake(path, f"must be a table with the keys {', '.join(known)}, got {shown(raw)}"))
        return None
    values: dict[str, Any] = {}
    own: list[Plugin] = []
    for key in raw:
        if kind is Fault and key not in known and (":" in key or key in FAULTS.names):
            own += _own(f"{path}.{key}", key, raw[key], found)
        elif key not in known:
            found.append(Mistake(f"{path}.{key}", _unknown(key, list(known))))
    for key, field in known.items():
        if key in raw:
            try:
                values[field.name] = msgspec.convert(raw[key], field.type)
            except msgspec.ValidationError as error:
                found.append(_wrong(f"{path}.{key}", raw[key], field.type, str(error)))
    if own:
        values["own"] = (*values.get("own", ()), *own)
    needed = _NEEDED.get(kind)
    if needed and needed not in raw:
        example = 'on = "inv4 <-> inv7"' if needed == "on" else 'name = "inv3"'
        found.append(Mistake(f"{path}.{needed}", f"is missing; write {example}"))
    return None if needed and needed not in values else kind(**values)


def _own(path: str, name: str, raw: Any, found: list[Mistake]) -> list[Plugin]:
    """A fault of somebody's own: a table of its parameters, or true."""
    if raw is False:
        return []
    table = {} if raw is True else raw
    if not isinstance(table, Mapping):
        text = f"must be true or a table of its parameters such as {{ p = 0.1 }}, got {shown(raw)}"
        found.append(Mistake(path, text))
        return []
    if wrong := {key: text for key, value in table.items() if (text := scalar_objection(value))}:
        found += [Mistake(f"{path}.{key}", text) for key, text in wrong.items()]
        return []
    if not isinstance(table.get("folder", ""), str) or is_no_path(table.get("folder", "")):
        found.append(Mistake(f"{path}.folder", f"must be the path of a folder, got {shown(table['folder'])}"))
        return []
    return [plugin_of({**table, "use": name})]


def _unknown(key: str, known: list[str]) -> str:
    bare = key.removesuffix("_ms")
    for right in (f"{key}_s", f"{bare}_s", key.rpartition("_")[0], bare):
        if right in known and right != key:
            return f"unknown key; write {right}{', in seconds' if right.endswith('_s') else ''}"
    return f"unknown key; {suggestion(key, known, 'keys')}"


def _wrong(path: str, raw: Any, kind: Any, error: str) -> Mistake:
    """One of msgspec's sentences as one of ours."""
    where = _WHERE.search(error)
    inside = where[1] if where else ""
    value = _inside(raw, inside)
    path += inside
    models = _models(kind)
    if error.startswith("Object contains unknown field"):
        key = error.split("`")[1]
        struct = models.get(value.get("model", ""), next(iter(models.values()))) if models else None
        keys = [field.encode_name for field in msgspec.structs.fields(struct)] if struct else []
        return Mistake(f"{path}.{key}", _unknown(key, keys))
    if error.startswith("Object missing required field"):
        key = error.split("`")[1]
        choice = f"; write one of {', '.join(filter(None, models))}" if key == "model" else ""
        return Mistake(f"{path}.{key}", f"is missing{choice}")
    if inside.endswith(".model"):
        return Mistake(path, f"there is no {shown(value)}; {suggestion(str(value), filter(None, models), 'models')}")
    expected = re.match(r"Expected `(\w+)", error)
    what = _WORDS.get(expected[1], expected[1]) if expected else "something else"
    if not inside:
        what = _expected(kind)
    hint = number_in(value) if isinstance(value, str) and "number" in what else ""
    return Mistake(path, f"must be {what}, got {shown(value)}{hint}")


def _models(kind: Any) -> dict[str, type[msgspec.Struct]]:
    """Structs that a key's value may be, by the name of the model; "" where there is no choice."""
    kinds = get_args(kind) or (kind,)
    structs = [one for one in kinds if isinstance(one, type) and issubclass(one, msgspec.Struct)]
    return {str(struct.__struct_config__.tag or ""): struct for struct in structs}


def _expected(kind: Any) -> str:
    """What a key takes, for people."""
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(shown(choice) for choice in get_args(kind) if choice)
    kinds, models = set(get_args(kind) or (kind,)), _models(kind)
    table = ""
    if models:
        table = (
            "a table with a model" if {*get_args(AnyDelay), *get_args(AnyLoss)} & set(models.values()) else "a table"
        )
    number = "a number" if float in kinds else "true or false" if bool in kinds else ""
    words = [word for word in (number, table) if word]
    if words:
        return " or ".join(words)
    return "a text in quotes" if str in kinds else 'a list of lists such as [["inv1", "inv2"], ["MG2"]]'


def _inside(raw: Any, path: str) -> Any:
    """The value at a path of msgspec's, as far as it goes."""
    for name, index in re.findall(r"\.([A-Za-z0-9_]+)|\[(\d+)\]", path):
        try:
            raw = raw[name] if name else raw[int(index)]
        except (KeyError, IndexError, TypeError):
            return raw
    return raw
