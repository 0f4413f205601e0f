"""Keys of a scenario file by their dotted path, as `gains.k_p` or `link[0].delay`, in its tree of tables."""

from __future__ import annotations

import re
import typing
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import msgspec

from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.wording import suggestion

_STEP = r"[A-Za-z0-9_-]+(?:\[\d+\])*"
_PATH = re.compile(rf"{_STEP}(?:\.{_STEP})*")

Tree = dict[str, Any]


class PathError(ValueError):
    """A path that leads nowhere in this scenario."""


def steps(path: str) -> list[str | int]:
    if not _PATH.fullmatch(path):
        raise PathError("is no path of a key; write it as gains.k_p, case.IV.graph or event[0].t_s")
    return [int(number) if number else name for number, name in re.findall(r"\[(\d+)\]|([^.\[\]]+)", path)]


def put(tree: Tree, path: str, value: Any) -> None:
    """Set a key in a scenario; PathError if a list has no such entry, or a new case is not given whole."""
    way = steps(path)
    node, last = _parent(tree, way, whole=isinstance(value, Mapping)), way[-1]
    node[last] = value


def remove(tree: Tree, path: str) -> None:
    """Take a key, a table or an entry out of the tables of a scenario, if it is written; PathError as in `put`."""
    way = steps(path)
    node, last = _parent(tree, way, whole=False), way[-1]
    if isinstance(last, int) or last in node:
        del node[last]


def _parent(tree: Tree, way: list[str | int], *, whole: bool) -> Any:
    """Return the table or list that the last step of a way is in, made if it is left to its defaults."""
    node: Any = tree
    for depth, (step, following) in enumerate(zip(way, [*way[1:], None], strict=True)):
        here = _written(way[: depth + 1])
        if isinstance(step, int):
            if not isinstance(node, list) or step >= len(node):
                count, of = len(node) if isinstance(node, list) else 0, here.rpartition("[")[0]
                there = f"{of} has {count} entries, from {of}[0]" if count else f"give {of} as a list first"
                raise PathError(f"there is no {here}; {there}")
        elif not isinstance(node, dict):
            raise PathError(f"{_written(way[:depth])} is not a table, so it has no key {step}")
        elif depth == 1 and way[0] in _named_tables() and step not in node and not (whole and following is None):
            known = suggestion(step, node, f"tables of {way[0]}")
            raise PathError(f"there is no {here}; {known}; a new one is given as a whole table, at {here}")
        if following is None:
            break
        if step in ("law", "graph") and isinstance(node.get(step), str):
            node[step] = {"use": node[step]}  # a name alone stands for this table, which takes parameters
        node = node[step] if isinstance(step, int) else node.setdefault(step, [] if isinstance(following, int) else {})
    return node


def flatten(
    table: Mapping[str, Any], is_leaf: Callable[[Any], bool] = lambda value: False, path: str = ""
) -> Iterator[tuple[str, Any]]:
    """Return keys with their values, whether the path was written in quotes or is nested tables of TOML."""
    for key, value in table.items():
        below = f"{path}.{key}" if path else key
        if isinstance(value, Mapping) and value and not is_leaf(value):
            yield from flatten(value, is_leaf, below)
        else:
            yield below, value


def _written(way: list[str | int]) -> str:
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in way)
    return text.removeprefix(".")


@cache
def _named_tables() -> frozenset[str]:
    """Return the keys of the scenario below which the user names the tables; a new name there is a slip."""
    fields = msgspec.structs.fields(ScenarioModel)
    return frozenset(field.encode_name for field in fields if typing.get_origin(field.type) is dict)
