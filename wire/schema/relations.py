"""Relations between the numbers of one table, as annotations of a field, and the search for those that fail. Pure.

low_s: Annotated[float, Unit("s"), Below("high_s")]
h_s: Annotated[float, Unit("s"), Divides("T_c_s")] = 0.002
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec

from gridpeers.wire.schema.table_schema import Field, Problem, below, fields_of, named


@dataclass(frozen=True)
class Below:
    """A number that must be less than that of another field."""

    field: str
    """Name of the other field."""
    or_equal: bool = False
    """Whether both may be equal."""
    only_with: str = ""
    """Name of a field without which, or with 0 in which, the relation does not hold."""

    def objection(self, value: float, other: float, key: str) -> str:
        """Return why a number does not stand so to the one at `key`, "" if it does."""
        if value <= other if self.or_equal else value < other:
            return ""
        rule = "not be above" if self.or_equal else "be below"
        return f"{value:g} must {rule} {key} = {other:g}; swap them or set both"


@dataclass(frozen=True)
class After:
    """An end (s) that must come after the beginning of another field."""

    field: str
    """Name of the other field."""
    only_with: str = ""
    """As of `Below`."""

    def objection(self, value: float, other: float, key: str) -> str:
        """Return why an end does not come after the beginning at `key`, "" if it does."""
        if value > other:
            return ""
        return f"{value:g} s is not after {key} = {other:g} s, so that the entry never holds"


@dataclass(frozen=True)
class MultipleOf:
    """A time (s) that must be a whole multiple of the step (s) of another field."""

    field: str
    """Name of the other field."""
    only_with: str = ""
    """As of `Below`."""

    def objection(self, value: float, step: float, key: str, rule: str = "") -> str:
        """Return why a time is no multiple of the step at `key`, "" if it is, or if one of them is not above 0.

        Examples
        --------
        >>> MultipleOf("T_c_s").objection(0.05, 0.02, "T_c_s")
        '0.05 s is not a multiple of T_c_s = 0.02 s; the nearest is 0.04'
        """
        if value <= 0 or step <= 0 or _whole(value / step):
            return ""
        near = f"{max(round(value / step), 1) * step:.9g}"
        return f"{value:g} s is not a multiple of {key} = {step:g} s{rule and f', {rule}'}; the nearest is {near}"


@dataclass(frozen=True)
class Divides:
    """A step (s) that must divide the time (s) of another field."""

    field: str
    """Name of the other field."""
    only_with: str = ""
    """As of `Below`."""

    def objection(self, step: float, value: float, key: str) -> str:
        """Return why a step does not divide the time at `key`, "" if it does, or if one of them is not above 0.

        Examples
        --------
        >>> Divides("T_c_s").objection(0.003, 0.02, "T_c_s")
        '0.003 s does not divide T_c_s = 0.02 s; the nearest that does is 0.0025'
        """
        if value <= 0 or step <= 0 or _whole(value / step):
            return ""
        ratio = value / step
        # a step that can be written down in microseconds, for 0.02 / 7 cannot be typed
        whole = [n for n in range(1, 2 * round(ratio) + 2) if abs(round(value / n, 6) * n - value) < 1e-12]
        near = value / min(whole, key=lambda n: abs(n - ratio), default=1)
        return f"{step:g} s does not divide {key} = {value:g} s; the nearest that does is {near:g}"


def contradictions(cls: type, values: Any, known: Callable[[Field], bool] = lambda field: True) -> list[Problem]:
    """Return the numbers that do not stand to those of other fields as they must.

    Parameters
    ----------
    cls : type
        Its fields say the relations.
    values : Any
        Has the values as attributes.
    known : Callable[[Field], bool], optional
        Whether a field has a right value; else nothing is said of it.

    Examples
    --------
    >>> from gridpeers.plant.plant_config import GfmParameters
    >>> contradictions(GfmParameters, GfmParameters(P_min=2.0))
    [Problem(path='P_min_pu', text='2 must be below P_max_pu = 1; swap them or set both')]
    """
    found: dict[str, str] = {}
    for field in fields_of(cls):
        for relation in (mark for mark in field.marks if isinstance(mark, Below | After | MultipleOf | Divides)):
            other = named(cls, relation.field)
            idle = {field.key, other.key} & found.keys() or not (known(field) and known(other))
            if idle or (relation.only_with and not getattr(values, relation.only_with)):
                continue
            numbers = getattr(values, field.name), getattr(values, other.name)
            if None not in numbers and (text := relation.objection(*numbers, other.key)):
                found[field.key] = text
    return [Problem(key, text) for key, text in found.items()]


def problems_of(struct: msgspec.Struct) -> list[Problem]:
    """Return the numbers of a struct, and of the structs below it, that are out of range.

    Without one, return where its values contradict each other: by its annotations, and by its method `relations` if it
    has one.

    Examples
    --------
    >>> from gridpeers.netem.models.loss import Bernoulli
    >>> problems_of(Bernoulli(p=2.0))
    [Problem(path='p', text='a loss is a probability from 0 to 1, got 2; did you mean 0.02 (2 %)?')]
    """
    found: list[Problem] = []
    for field in fields_of(type(struct)):
        value = getattr(struct, field.name)
        if isinstance(value, msgspec.Struct):
            found += below(field.key, problems_of(value))
        elif isinstance(value, (int, float)) and not isinstance(value, bool) and (text := field.objection(value)):
            found.append(Problem(field.key, text))
    return found or [*contradictions(type(struct), struct), *getattr(struct, "relations", list)()]


def _whole(ratio: float) -> bool:
    """Return whether a ratio is 1, 2, 3, ...; the tolerance is that of decimal fractions in binary."""
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-6
