"""What the fields of a struct say about a table of a file: annotations, keys with units, and ranges. Pure.

A table is a `msgspec.Struct` whose fields carry annotations:

    class Time(msgspec.Struct, frozen=True, kw_only=True):
        T_c_s: Annotated[float, Unit("s"), Plausible("a control period", 0.0005, 2.0, above_zero=True)] = 0.02

`wire.table_reading` reads tables by them, and the reference pages and the writer take keys and units from them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin

import msgspec

from wire.plausible import Plausible, Probability, Range, Unit


class Problem(NamedTuple):
    """One problem of a table."""

    path: str
    """Which key, e.g. `link[2].loss.p`; relative to the table where the table finds it."""
    text: str
    """What is wrong, with the value and its unit, and what would be right."""


@dataclass(frozen=True)
class Example:
    """A right value, written as in the file."""

    text: str


@dataclass(frozen=True)
class Shorthand:
    """A number alone stands for a struct with one field given."""

    struct: type[msgspec.Struct]
    field: str

    def of(self, value: float) -> msgspec.Struct:
        """Return the struct that a number stands for."""
        return self.struct(**{self.field: value})


@dataclass(frozen=True)
class OtherKeys:
    """The field, a tuple, takes what stands under keys that no other field has.

    Attributes
    ----------
    accepts : Callable[[str], bool]
        Whether a key is one of them.
    read : Callable[[str, Any, list[Problem]], tuple]
        From a key and its value to elements of the tuple, problems noted.
    """

    accepts: Callable[[str], bool]
    read: Callable[[str, Any, list[Problem]], tuple[Any, ...]]


INLINE = "inline"
"""Annotation of a field whose struct has its keys in the table around it."""

NO_KEY = "no key"
"""Annotation of a field that no file gives."""

INHERITED = "inherited"
"""Annotation of a table that takes what it leaves out from the table of the same name at the top of the file."""


class Field(NamedTuple):
    """One field of a table."""

    name: str
    """Of the attribute."""
    key: str
    """In the file: the name, with its unit at the end where the unit can be a part of a key."""
    type: Any
    """Without annotations."""
    marks: tuple[Any, ...]
    """The annotations."""
    info: msgspec.structs.FieldInfo
    """As msgspec has it."""

    def mark(self, kind: Any) -> Any:
        """Return the annotation of a class, None if there is none."""
        return next((mark for mark in self.marks if isinstance(mark, kind)), None)

    @property
    def unit(self) -> str:
        """Unit of the number, "" if it has none."""
        unit = self.mark(Unit)
        return unit.text if unit else ""

    @property
    def required(self) -> bool:
        """Whether a table must have the key."""
        return self.info.required

    @property
    def default(self) -> Any:
        """Value if none is given."""
        if self.info.default is not msgspec.NODEFAULT:
            return self.info.default
        return self.info.default_factory()

    def objection(self, value: Any) -> str:
        """Return why a number cannot be the field's, "" if it can."""
        allowed = self.mark((Plausible, Probability, Range))
        return allowed.objection(value, self.unit) if allowed else ""


@cache
def fields_of(struct: type[msgspec.Struct]) -> tuple[Field, ...]:
    """Return the fields of a struct in their order.

    Examples
    --------
    >>> class Filter(msgspec.Struct):
    ...     T: Annotated[float, Unit("s")] = 0.01
    ...     delay_s: Annotated[float, Unit("s")] = 0.0
    ...     k: Annotated[float, Unit("1/s")] = 1.0
    >>> [field.key for field in fields_of(Filter)]
    ['T_s', 'delay_s', 'k']
    """
    found = []
    for info in msgspec.structs.fields(struct):
        kind, marks = (get_args(info.type)[0], get_args(info.type)[1:]) if _annotated(info.type) else (info.type, ())
        unit = next((mark.text for mark in marks if isinstance(mark, Unit)), "")
        suffix = f"_{unit}" if unit.isidentifier() else ""
        key = info.encode_name if info.encode_name.endswith(suffix) else info.encode_name + suffix
        found.append(Field(info.name, key, kind, marks, info))
    return tuple(found)


def problems_of(struct: msgspec.Struct) -> list[Problem]:
    """Return the numbers of a struct, and of the structs below it, that are out of range.

    Without one, return what its method `relations` finds, if it has one: what its values ask of each other.

    Examples
    --------
    >>> class Loss(msgspec.Struct):
    ...     p: Annotated[float, Probability("a loss")]
    >>> problems_of(Loss(p=2.0))
    [Problem(path='p', text='a loss is a probability from 0 to 1, got 2; did you mean 0.02 (2 %)?')]
    """
    found: list[Problem] = []
    for field in fields_of(type(struct)):
        value = getattr(struct, field.name)
        shorthand = field.mark(Shorthand)
        if isinstance(value, msgspec.Struct):
            found += below(field.key, problems_of(value))
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            judge = named(shorthand.struct, shorthand.field) if shorthand else field
            if text := judge.objection(value):
                found.append(Problem(field.key, text))
    return found or list(getattr(struct, "relations", list)())


def named(struct: type[msgspec.Struct], name: str) -> Field:
    """Return one field of a struct."""
    return next(field for field in fields_of(struct) if field.name == name)


def below(path: str, problems: Iterable[Problem]) -> list[Problem]:
    """Return the same problems, seen from further up.

    Examples
    --------
    >>> below("link[2]", [Problem("loss.p", "wrong"), Problem("", "empty")])
    [Problem(path='link[2].loss.p', text='wrong'), Problem(path='link[2]', text='empty')]
    """
    return [Problem(f"{path}.{problem.path}" if problem.path else path, problem.text) for problem in problems]


def _annotated(kind: Any) -> bool:
    return get_origin(kind) is Annotated
