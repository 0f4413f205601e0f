"""Declarations of a table of a file on the fields of a class: annotations, keys with units, and ranges. Pure.

A table is a `msgspec.Struct`, or any class with parameters, such as a law. Its fields carry annotations:

    class Time(msgspec.Struct, frozen=True, kw_only=True):
        T_c_s: Annotated[float, Unit("s"), Plausible("a control period", 0.0005, 2.0, above_zero=True)] = 0.02

    class Mine(Law):
        gain: Annotated[float, Unit("1/s"), Range(0, 100), "Rate of the consensus."] = 5.0

A field without a default must be given. Of a class that is no struct, names that begin with "_" and class variables are
no fields. `gridpeers.wire.schema.table_reading` reads tables by the fields; the reference pages, the writer of
scenarios and the axes of plots take keys, units and ranges from them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Any, ClassVar, NamedTuple, get_args, get_origin, get_type_hints

import msgspec

from gridpeers.wire.schema.plausible import Plausible, Probability, Range, Unit


class Problem(NamedTuple):
    path: str
    """Which key, e.g. `link[2].loss.p`; relative to the table where the table finds it."""
    text: str
    """The error, with the value, its unit, and a right value."""


@dataclass(frozen=True)
class Example:
    text: str


@dataclass(frozen=True)
class Shorthand:
    """A number alone stands for a struct with one field given."""

    struct: type[msgspec.Struct]
    field: str

    def of(self, value: float) -> msgspec.Struct:
        return self.struct(**{self.field: value})


@dataclass(frozen=True)
class OtherKeys:
    """The field, a tuple, takes what stands under keys that no other field has."""

    accepts: Callable[[str], bool]
    read: Callable[[str, Any, list[Problem]], tuple[Any, ...]]
    """From a key and its value to elements of the tuple, problems noted."""
    write: Callable[[Any], tuple[str, Any]]
    """From an element of the tuple to its key and value."""


@dataclass(frozen=True)
class NamedTables:
    """The field, a dict, takes tables under keys that no other field has, each of the struct of its name."""

    known: Callable[[], Mapping[str, type[msgspec.Struct]]]
    """Returns the structs by name; called when there is another key."""


@dataclass(frozen=True)
class Label:
    """Words for the field beside its unit: at an axis, or over a column."""

    text: str


@dataclass(frozen=True)
class Flag:
    name: str


INLINE = Flag("inline")
"""Annotation of a field whose struct has its keys in the table around it."""

NO_KEY = Flag("no key")
"""Annotation of a field that no file gives."""

INHERITED = Flag("inherited")
"""Annotation of a table that takes what it leaves out from the table of the same name at the top of the file."""


class Field(NamedTuple):
    name: str
    key: str
    """In the file: the name, of a struct with its unit at the end where the unit can be a part of a key."""
    type: Any
    """Without annotations."""
    marks: tuple[Any, ...]
    """The annotations."""
    make_default: Callable[[], Any] | None
    """Makes the value if none is given; None if a table must have the key."""

    def mark(self, kind: Any) -> Any:
        return next((mark for mark in self.marks if isinstance(mark, kind)), None)

    @property
    def number(self) -> Field:
        shorthand = self.mark(Shorthand)
        return named(shorthand.struct, shorthand.field) if shorthand else self

    @property
    def unit(self) -> str:
        unit = self.number.mark(Unit)
        return unit.text if unit else ""

    @property
    def span(self) -> str:
        allowed = self._allowed
        return allowed.span if allowed else ""

    @property
    def help(self) -> str:
        return next((mark for mark in self.marks if isinstance(mark, str)), "")

    @property
    def required(self) -> bool:
        return self.make_default is None

    @property
    def default(self) -> Any:
        assert self.make_default is not None, self.name
        return self.make_default()

    def objection(self, value: Any) -> str:
        """Return why a number cannot be the field's, "" if it can."""
        if (allowed := self._allowed) and (text := allowed.objection(value, self.unit)):
            return text
        return f"must be a finite number, got {value}" if isinstance(value, float) and not math.isfinite(value) else ""

    @property
    def _allowed(self) -> Plausible | Probability | Range | None:
        return self.number.mark((Plausible, Probability, Range))  # type: ignore[no-any-return]


@cache
def fields_of(cls: type) -> tuple[Field, ...]:
    """Return the fields of a class in their order, those of its base classes first.

    Raise TypeError if an annotation of a class that is no struct cannot be read.
    """
    return tuple((_of_struct if issubclass(cls, msgspec.Struct) else _of_class)(cls))


def _of_struct(cls: type[msgspec.Struct]) -> Iterator[Field]:
    for info in msgspec.structs.fields(cls):
        kind, marks = _apart(info.type)
        unit = next((mark.text for mark in marks if isinstance(mark, Unit) and mark.in_key), "")
        suffix = f"_{unit}" if unit.isidentifier() else ""
        key = info.encode_name.removesuffix(suffix) + suffix
        make: Any = info.default_factory
        if info.default is not msgspec.NODEFAULT:
            make = partial(_same, info.default)
        yield Field(info.name, key, kind, marks, None if info.required else make)


def _of_class(cls: type) -> Iterator[Field]:
    try:
        hints = get_type_hints(cls, include_extras=True)
    except Exception as error:  # a name in an annotation may lead to anything
        raise TypeError(f"the annotations of {cls.__name__} cannot be read: {error}") from None
    for name, hint in hints.items():
        if not (name.startswith("_") or get_origin(hint) is ClassVar or hint is ClassVar):
            kind, marks = _apart(hint)
            yield Field(name, name, kind, marks, partial(_same, getattr(cls, name)) if hasattr(cls, name) else None)


def _apart(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    return (get_args(hint)[0], get_args(hint)[1:]) if get_origin(hint) is Annotated else (hint, ())


def _same(value: Any) -> Any:
    return value


def named(cls: type, name: str) -> Field:
    return next(field for field in fields_of(cls) if field.name == name)


def below(path: str, problems: Iterable[Problem]) -> list[Problem]:
    """Return the same problems, seen from further up."""
    return [Problem(".".join(filter(None, (path, problem.path))), problem.text) for problem in problems]


@dataclass(frozen=True)
class Relation:
    """What a number must be beside that of another field."""

    field: str
    """Name of the other field."""
    only_with: str = ""
    """Name of a field without which, or with 0 in which, the relation does not hold."""

    def objection(self, value: float, other: float, key: str) -> str:
        """Return why a number contradicts the one at `key`, "" if it does not."""
        raise NotImplementedError


@dataclass(frozen=True)
class Below(Relation):
    or_equal: bool = False

    def objection(self, value: float, other: float, key: str) -> str:
        if value <= other if self.or_equal else value < other:
            return ""
        rule = "not be above" if self.or_equal else "be below"
        return f"{value:g} must {rule} {key} = {other:g}; swap them or set both"


class After(Relation):
    """An end (s) that must come after the beginning of another field."""

    def objection(self, value: float, other: float, key: str) -> str:
        if value > other:
            return ""
        return f"{value:g} s is not after {key} = {other:g} s, so that the entry never holds"


class MultipleOf(Relation):
    """A time (s) that must be a whole multiple of the step (s) of another field."""

    def objection(self, value: float, other: float, key: str, rule: str = "") -> str:
        if value <= 0 or other <= 0 or _whole(value / other):
            return ""
        near = f"{max(round(value / other), 1) * other:.9g}"
        return f"{value:g} s is not a multiple of {key} = {other:g} s{rule and f', {rule}'}; the nearest is {near}"


class Divides(Relation):
    """A step (s) that must divide the time (s) of another field."""

    def objection(self, value: float, other: float, key: str) -> str:
        if value <= 0 or other <= 0 or _whole(other / value):
            return ""
        ratio = other / value
        # a step that can be written down in microseconds, for 0.02 / 7 cannot be typed
        whole = [n for n in range(1, 2 * round(ratio) + 2) if abs(round(other / n, 6) * n - other) < 1e-12]
        near = other / min(whole, key=lambda n: abs(n - ratio), default=1)
        return f"{value:g} s does not divide {key} = {other:g} s; the nearest that does is {near:g}"


def _whole(ratio: float) -> bool:
    """Return whether a ratio is 1, 2, 3, ...; the tolerance is that of decimal fractions in binary."""
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-6


def contradictions(cls: type, values: Any, known: Callable[[Field], bool] = lambda field: True) -> list[Problem]:
    """Return the numbers that contradict those of other fields, where both fields are `known` right."""
    found: dict[str, str] = {}
    for field in fields_of(cls):
        for relation in (mark for mark in field.marks if isinstance(mark, Relation)):
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

    If there are none, return where its values contradict each other, by its annotations and its method `relations`.
    """
    found: list[Problem] = []
    for field in fields_of(type(struct)):
        value = getattr(struct, field.name)
        if isinstance(value, msgspec.Struct):
            found += below(field.key, problems_of(value))
        elif isinstance(value, (int, float)) and not isinstance(value, bool) and (text := field.objection(value)):
            found.append(Problem(field.key, text))
    return found or [*contradictions(type(struct), struct), *getattr(struct, "relations", list)()]
