"""Parameters of a plugged-in class: annotated attributes with unit, range and help, and their check. Pure.

    class Mine(Law):
        gain: Annotated[float, Unit("1/s"), Range(0, 100), "Rate of the consensus."] = 5.0

An attribute without a default must be given. Names that begin with "_", and class variables, are no parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, get_args, get_origin, get_type_hints

import msgspec

from wire.plausible import Range, Unit
from wire.printable import printable
from wire.suggestion import suggestion
from wire.table_reading import in_words

REQUIRED = msgspec.NODEFAULT
"""Default of a parameter that must be given."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a class.

    Attributes
    ----------
    type : Any
        What its values are: float, int, bool, str, a Literal, a list of these.
    default : Any
        Its value if none is given, or `REQUIRED`.
    unit, help : str
        For people; may be empty.
    range : Range
        Of a number.
    """

    name: str
    type: Any
    default: Any
    unit: str
    help: str
    range: Range

    def __str__(self) -> str:
        """Return one line of a reference page.

        Examples
        --------
        >>> print(Parameter("gain", float, 5.0, "1/s", "Rate.", Range(0.0, 100.0)))
        gain = 5.0 (1/s, 0 to 100): Rate.
        """
        low, high = self.range.low, self.range.high
        bounds = f"{low:g} to {high:g}" if math.isfinite(low + high) else f"at least {low:g}"
        if math.isinf(low):
            bounds = f"at most {high:g}" if math.isfinite(high) else ""
        about = ", ".join(part for part in (self.unit, bounds) if part)
        value = "must be given" if self.default is REQUIRED else repr(self.default)
        return f"{self.name} = {value}" + (f" ({about})" if about else "") + (f": {self.help}" if self.help else "")


def parameters_of(cls: type) -> dict[str, Parameter]:
    """Return the parameters of a class and of what it is derived from, the latter first.

    Raises
    ------
    TypeError
        If an annotation cannot be read, or a default is not of its type.
    """
    try:
        hints = get_type_hints(cls, include_extras=True)
    except Exception as error:  # a name in an annotation may lead to anything
        raise TypeError(f"the annotations of {cls.__name__} cannot be read: {error}") from None
    found = {}
    for name, hint in hints.items():
        if name.startswith("_") or get_origin(hint) is ClassVar or hint is ClassVar:
            continue
        about: tuple[Any, ...] = ()
        if get_origin(hint) is Annotated:
            hint, *extras = get_args(hint)
            about = tuple(extras)
        parameter = Parameter(
            name=name,
            type=hint,
            default=getattr(cls, name, REQUIRED),
            unit=next((it.text for it in about if isinstance(it, Unit)), ""),
            help=next((it for it in about if isinstance(it, str)), ""),
            range=next((it for it in about if isinstance(it, Range)), Range()),
        )
        if parameter.default is not REQUIRED and (wrong := _objection(parameter, parameter.default)):
            raise TypeError(f"{cls.__name__}.{name}: its default {wrong}")
        found[name] = parameter
    return found


def parameter_objection(cls: type, taken: tuple[str, ...]) -> str:
    """Return why a class cannot have the parameters that it has, "" if it can.

    Parameters
    ----------
    cls : type
        The class.
    taken : tuple[str, ...]
        Names that mean something else, in a scenario's table or in the class.

    Examples
    --------
    >>> class Mine:
    ...     folder: str = ""
    >>> parameter_objection(Mine, ("use", "folder"))
    'its parameter folder cannot be given, as a scenario has the key folder for something else; give it another name'
    """
    try:
        found = parameters_of(cls)
    except TypeError as error:
        return str(error)
    return next(
        (
            f"its parameter {name} cannot be given, as a scenario has the key {name} for something else; give it "
            "another name"
            for name in found
            if name in taken
        ),
        "",
    )


def objections(cls: type, given: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return all that is wrong with values for the parameters of a class: for each the name and a sentence.

    Examples
    --------
    >>> class Law:
    ...     gain: Annotated[float, Unit("1/s"), Range(0, 100)] = 5.0
    ...     order: int
    >>> for name, text in objections(Law, {"gain": 500, "gian": 1}): print(f"{name}: {text}")
    gian: unknown parameter; did you mean "gain"? The parameters are gain, order
    gain: must be from 0 to 100 1/s, got 500
    order: must be given, a whole number
    """
    known = parameters_of(cls)
    wrong = [
        (name, f"unknown parameter; {suggestion(name, known, 'parameters')}") for name in given if name not in known
    ]
    for name, parameter in known.items():
        if name in given:
            if text := _objection(parameter, given[name]):
                wrong.append((name, text))
        elif parameter.default is REQUIRED:
            wrong.append((name, f"must be given, {in_words(parameter.type)}"))
    return wrong


def values_of(cls: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every parameter of a class, converted to its type.

    Raises
    ------
    ValueError
        If a value is wrong or missing; the text has all problems.
    """
    if wrong := objections(cls, given):
        raise ValueError("; ".join(f"{name}: {text}" for name, text in wrong))
    return {
        name: msgspec.convert(given[name], parameter.type) if name in given else parameter.default
        for name, parameter in parameters_of(cls).items()
    }


def _objection(parameter: Parameter, value: Any) -> str:
    """Return why a value cannot be one of a parameter, "" if it can."""
    shown = f'"{printable(value, 60)}"' if isinstance(value, str) else printable(str(value), 60)
    try:
        value = msgspec.convert(value, parameter.type)
    except msgspec.ValidationError:
        return f"must be {in_words(parameter.type)}, got {shown}"
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return parameter.range.objection(value, parameter.unit)
    return ""
