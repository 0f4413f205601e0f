"""Declarations of a table of a file on the fields of a class: annotations, keys with units, and ranges. Pure.

A table is a `msgspec.Struct`, or any class with parameters, such as a law. Its fields carry annotations:

    class Time(msgspec.Struct, frozen=True, kw_only=True):
        T_c_s: Annotated[float, Unit("s"), Plausible("a control period", 0.0005, 2.0, above_zero=True)] = 0.02

    class Mine(Law):
        gain: Annotated[float, Unit("1/s"), Range(0, 100), "Rate of the consensus."] = 5.0

A field without a default must be given. Of a class that is no struct, names that begin with "_" and class variables are
no fields. `Range` bounds the values that code can use. `Plausible` bounds what makes sense: wide enough for every value
that somebody might want to try, and too narrow for one that only a lost unit explains. An `objection` is the end of a
sentence that says why a value cannot be right, or "". `gridpeers.wire.schema.table_reading` reads tables by the fields;
the reference pages, the writer of scenarios and the axes of plots take keys, units and ranges from them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Any, ClassVar, NamedTuple, get_args, get_origin, get_type_hints

import msgspec

from gridpeers.wire.wording import printable


@dataclass(frozen=True)
class Unit:
    """Unit of a parameter, e.g. `Unit("1/s")`; a pure number or a text has none."""

    text: str
    in_key: bool = True
    """Whether the key of a file ends in the unit, if the unit can be a part of a key."""


@dataclass(frozen=True)
class Range:
    """Least and greatest allowed value of a parameter."""

    low: float = -math.inf
    high: float = math.inf

    @property
    def span(self) -> str:
        low, high = (str(bound) if isinstance(bound, int) else f"{bound:g}" for bound in (self.low, self.high))
        if math.isfinite(self.low):
            return f"{low} to {high}" if math.isfinite(self.high) else f"at least {low}"
        return f"at most {high}" if math.isfinite(self.high) else ""

    def objection(self, value: Any, unit: str = "") -> str:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return f"must be a number, got {printable(str(value), 60)}"
        if not math.isfinite(value):
            return f"must be a finite number, got {value:g}"
        if self.low <= value <= self.high:
            return ""
        bounds = f"from {self.span}" if " to " in self.span else self.span
        return f"must be {bounds}{f' {unit}' if unit else ''}, got {value:g}"


@dataclass(frozen=True)
class Plausible:
    """Plausible range of a parameter; the message on a value outside suggests the value that was meant."""

    what: str
    """Name of the quantity with its article, such as "a dead band"."""
    low: float
    """Lowest plausible value; with `above_zero`, zero and less is an error of its own."""
    high: float
    above_zero: bool = False
    hint: str | Callable[[float], str] = ""
    """End of the message on an implausible value, or a function from the value to it."""

    @property
    def span(self) -> str:
        return f"{self.low:g} to {self.high:g}"

    def objection(self, value: float, unit: str = "") -> str:
        """Return why a number is implausible, with a suggestion.

        Examples
        --------
        >>> Plausible("a control period", 5e-4, 2.0, above_zero=True).objection(20.0, "s")
        '20 s is not plausible for a control period (0.0005 to 2 s); did you mean 0.02 (20 ms)?'
        """
        if abs(value) > 1e300:  # a whole number may be beyond any float
            value = math.inf if value > 0 else -math.inf
        text = f" {unit}" if unit else ""
        hint = self.hint if isinstance(self.hint, str) else self.hint(value)
        rule = ""
        if not math.isfinite(value):
            rule, text = "be a finite number", ""
        elif self.above_zero and value <= 0:
            rule = "be above 0"
        elif self.low == 0 and value < 0:
            rule = "not be negative"
        span = f"{self.span} {unit}" if unit else self.span
        if rule:
            return f"{self.what} must {rule}, got {value:g}{text}; {span} makes sense{hint}"
        if self.low <= value <= self.high:
            return ""
        return f"{value:g}{text} is not plausible for {self.what} ({span}){self._meant(value, unit) or hint}"

    def _meant(self, value: float, unit: str) -> str:
        for factor, other in _OTHER_UNITS.get(unit, ()):
            if self.low <= value * factor <= self.high:
                return f"; did you mean {value * factor:g} ({value:g} {other})?"
        return "; it is per unit of the rating, neither kW nor V" if unit == "pu" and abs(value) > 100 else ""


def in_percent(value: float) -> str:
    """Return the end of a sentence about a number from 0 to 1 that was written in percent, "" if it was not."""
    return f"; did you mean {value / 100.0:g} ({value:g} %)?" if 1.0 < value <= 100.0 else ""


def probability(what: str, above_zero: bool = False) -> Plausible:
    """Return the range of a probability; with `above_zero` it divides another number, so that all below 1e-12 is wrong.

    `what` follows the word, such as "of a loss".
    """
    return Plausible(f"the probability {what}", 1e-12 if above_zero else 0.0, 1.0, above_zero, in_percent)


_OTHER_UNITS: dict[str, tuple[tuple[float, str], ...]] = {
    "s": ((1e-3, "ms"),),
    "kW": ((1e-3, "W"), (1e3, "MW")),
    "kvar": ((1e-3, "var"), (1e3, "Mvar")),
    "kVA": ((1e-3, "VA"), (1e3, "MVA")),
    "kV": ((1e-3, "V"),),
    "m": ((1e3, "km"), (1e-3, "mm")),
    "Hz": ((1e-3, "mHz"), (1e3, "kHz")),
    "ohm/km": ((1e-3, "ohm/1000 km"), (1e3, "ohm/m")),
    "pu": ((1e-2, "%"),),
    "%": ((1e2, "pu"),),
}
"""By unit: factors that turn a number written in another unit into it."""


def number_in(text: str) -> str:
    """Return the end of a sentence that says what to write instead of a text with a unit, "" if it is none.

    Examples
    --------
    >>> number_in("20 ms"), number_in("64.7%"), number_in("soon")
    ('; write 0.02', '; write 0.647', '')
    """
    match = re.fullmatch(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(us|ms|s|%|pu|Hz|mHz)?\s*", text)
    if match is None:
        return ""
    factor = {"us": 1e-6, "ms": 1e-3, "%": 1e-2, "mHz": 1e-3}.get(match[2] or "", 1.0)
    return f"; write {float(match[1]) * factor:g}"


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
class ChosenBy:
    """The table says by a key which struct it is read as; the field's type is that of a table without the key."""

    key: str
    choose: Callable[[Mapping[str, Any]], type[msgspec.Struct]]
    """From the table to its struct; a ValueError says what is wrong with the key."""


@dataclass(frozen=True)
class Label:
    """Words for the field beside its unit: at an axis, or over a column."""

    text: str


@dataclass(frozen=True)
class Flag:
    name: str


INLINE = Flag("inline")  # Annotation of a field whose struct has its keys in the table around it
NO_KEY = Flag("no key")  # Annotation of a field that no file gives
SHARED = Flag("shared")  # Annotation of a shared variable of a law, which is no parameter (`shared_fields`)

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
        """Return why a number cannot be the field's, "" if it can, or if the value is None."""
        if value is None:
            return ""
        if (allowed := self._allowed) and (text := allowed.objection(value, self.unit)):
            return text
        return f"must be a finite number, got {value}" if isinstance(value, float) and not math.isfinite(value) else ""

    @property
    def _allowed(self) -> Plausible | Range | None:
        return self.number.mark((Plausible, Range))  # type: ignore[no-any-return]


@cache
def fields_of(cls: type) -> tuple[Field, ...]:
    """Return the fields of a class in their order, those of its base classes first.

    Raise TypeError if an annotation of a class that is no struct cannot be read.
    """
    fields = (_of_struct if issubclass(cls, msgspec.Struct) else _of_class)(cls)
    return tuple(field for field in fields if SHARED not in field.marks)


def shared_fields(cls: type) -> tuple[Field, ...]:
    """Return the fields of a law that are no parameters, but values that it shares."""
    return tuple(field for field in _of_class(cls) if SHARED in field.marks)


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

    def objection(self, value: float, other: float, key: str, unit: str) -> str:
        """Return why a number contradicts the one at `key`, "" if it does not; `unit`: of both, after a space."""
        raise NotImplementedError


@dataclass(frozen=True)
class Below(Relation):
    or_equal: bool = False

    def objection(self, value: float, other: float, key: str, unit: str) -> str:
        if value <= other if self.or_equal else value < other:
            return ""
        rule = "not be above" if self.or_equal else "be below"
        return f"{value:g}{unit} must {rule} {key} = {other:g}{unit}; swap them or set both"


class After(Relation):
    """An end that must come after the beginning of another field."""

    def objection(self, value: float, other: float, key: str, unit: str) -> str:
        if value > other:
            return ""
        return f"{value:g}{unit} is not after {key} = {other:g}{unit}, so that the entry never holds"


class MultipleOf(Relation):
    """A time that must be a whole multiple of the step of another field."""

    def objection(self, value: float, other: float, key: str, unit: str, rule: str = "") -> str:
        if value <= 0 or other <= 0 or _whole(value / other):
            return ""
        near = f"{max(round(value / other), 1) * other:.9g}"
        rule = rule and f", {rule}"
        return f"{value:g}{unit} is not a multiple of {key} = {other:g}{unit}{rule}; the nearest is {near}"


class Divides(Relation):
    """A step that must divide the time of another field."""

    def objection(self, value: float, other: float, key: str, unit: str) -> str:
        if value <= 0 or other <= 0 or _whole(other / value):
            return ""
        ratio = other / value
        # a step that can be written down in microseconds, for 0.02 / 7 cannot be typed
        whole = [n for n in range(1, 2 * round(ratio) + 2) if abs(round(other / n, 6) * n - other) < 1e-12]
        near = other / min(whole, key=lambda n: abs(n - ratio), default=1)
        return f"{value:g}{unit} does not divide {key} = {other:g}{unit}; the nearest that does is {near:g}"


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
            unit = field.unit and f" {field.unit}"
            if None not in numbers and (text := relation.objection(*numbers, other.key, unit)):
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
