"""The links of an entry: `"inv4 <-> inv7"`, `"MG1 -> MG2"`, `"* -> inv2"`, `"plant -> inv2"`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import NamedTuple

from gridpeers.wire.messages import PLANT
from gridpeers.wire.wording import suggestion

ANY = "*"  # All agents; the plant only where it is named

_ARROW = re.compile(r"(.*?)\s*(<->|->)\s*(.*)")


class Link(NamedTuple):
    """A directed link; the plant is an end as the agents are."""

    src: str
    dst: str

    def __str__(self) -> str:
        return f"{self.src} -> {self.dst}"


class EndSet(NamedTuple):
    names: tuple[str, ...]
    """Inverters, microgrids, "plant" or "*"."""

    def holds(self, name: str, microgrids: Mapping[str, str]) -> bool:
        if name in self.names or (ANY in self.names and name != PLANT):
            return True
        microgrid = microgrids.get(name)
        return microgrid is not None and microgrid.lower() in (other.lower() for other in self.names)


class Pattern(NamedTuple):
    """A set of directed links, of those who are there and of those who are yet to come."""

    left: EndSet
    right: EndSet
    both: bool
    """Whether it also means the links back."""

    def matches(self, src: str, dst: str, microgrids: Mapping[str, str]) -> bool:
        if src == dst:
            return False
        if self.left.holds(src, microgrids) and self.right.holds(dst, microgrids):
            return True
        return self.both and self.left.holds(dst, microgrids) and self.right.holds(src, microgrids)


@lru_cache(maxsize=1024)
def parse(text: str) -> Pattern:
    """Read a pattern; ValueError shows the right form.

    Examples
    --------
    >>> microgrids = {"inv1": "MG1", "inv2": "MG1", "inv4": "MG2"}
    >>> parse("mg1 -> {inv4, plant}").matches("inv2", "inv4", microgrids)
    True
    >>> parse("* <-> *").matches("inv2", "plant", microgrids)
    False
    """
    found = _ARROW.fullmatch(text.strip())
    if found is None:
        hint = "; write the sender first" if "<-" in text else ""
        raise ValueError(f'"{text}" names no links{hint}; write "inv4 <-> inv7", "MG1 -> MG2" or "* -> inv2"')
    return Pattern(_side(found[1], text), _side(found[3], text), found[2] == "<->")


def _side(text: str, whole: str) -> EndSet:
    if text.startswith("{") and text.endswith("}"):
        names = tuple(name.strip() for name in text[1:-1].split(","))
    else:
        names = (text,)
    if not all(re.fullmatch(r"\*|[A-Za-z0-9_.-]+", name) for name in names):
        rule = "write an inverter, a microgrid, plant, *, or several as {inv1, inv2}"
        raise ValueError(f'"{text}" in "{whole}" is not a name; {rule}')
    return EndSet(names)


def objections(text: str, names: Iterable[str] | None, microgrids: Mapping[str, str]) -> list[str]:
    """Return the problems of a pattern: wrong form, unknown names, or no link at all; without `names` any may be one.

    Examples
    --------
    >>> objections("inv1 -> inv2", ["inv1", "inv2"], {})
    []
    >>> objections("a -> inv1", ["inv1"], {})
    ['"a -> inv1" matches no link: there is no "a"; the names are inv1, plant, *']
    """
    try:
        pattern = parse(text)
    except ValueError as error:
        return [str(error)]
    named = dict.fromkeys((*pattern.left.names, *pattern.right.names))
    if names is None and [*named] != [PLANT]:
        return []
    agents = list(names or ())
    groups = list(dict.fromkeys(microgrids[name] for name in agents if name in microgrids))
    known = [*agents, *groups, PLANT, ANY]
    lower = {group.lower() for group in groups}
    if unknown := [name for name in named if name not in known and name.lower() not in lower]:
        return [
            f'"{text}" matches no link: there is no "{name}"; {suggestion(name, known, "names")}' for name in unknown
        ]
    if any(pattern.matches(src, dst, microgrids) for src, dst in links_among(agents)):
        return []
    name = next((name for name in (PLANT, *agents) if pattern.left.holds(name, microgrids)), "")
    if not name:
        return [f'"{text}" matches no link: there is no inverter']
    return [
        f'"{text}" matches no link: both ends are {name}; write two different ends, '
        f'e.g. "{name} <-> {PLANT if agents == [name] else ANY}"'
    ]


def links_among(names: Iterable[str]) -> list[Link]:
    ends = [*names, PLANT]
    return [Link(src, dst) for src in ends for dst in ends if src != dst]
