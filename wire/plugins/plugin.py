"""Plug-ins: the shape that a class or function must have, how a scenario names one, and how it is made. Pure."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from math import isfinite
from typing import Any

import msgspec

from gridpeers.wire.plugins.registry import ANYTHING, PluginError, Registry, named
from gridpeers.wire.schema.table_reading import in_words, parameter_values, read_parameters, shown
from gridpeers.wire.schema.table_schema import Problem, fields_of
from gridpeers.wire.wording import printable

KEYS = ("use", "folder")  # Keys of a plug-in's table that are no parameters of it


def scalar_objection(value: Any) -> str:
    """Return why a value cannot be one of a parameter, whatever the parameter; "" if it can."""
    written = printable(repr(value), 60)
    if not isinstance(value, str | int | float):
        return f"a parameter is a number, a text, or true or false; got {written}"
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return f"a whole number has at most 64 bits; got {written}"
    if isinstance(value, float) and not isfinite(value):
        return f"must be a finite number, got {written}"
    return ""


class Plugin(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A function, or a class with parameters, of a registry."""

    use: str
    """Registered name, or `module:Name`."""
    folder: str = ""
    """Folder in which the module is searched."""
    parameters: tuple[tuple[str, float | int | bool | str], ...] = ()
    """Names and values of the parameters that differ from their defaults, in the order of the names."""


def table_of(key: str | Mapping[str, Any]) -> dict[str, Any]:
    """Return a scenario's key as a table, a copy: a text alone is its `use`."""
    return {"use": key} if isinstance(key, str) else dict(key)


def plugin_of(text: str | Mapping[str, Any], folder: str = "") -> Plugin:
    """Return what a scenario's key says: a text, or a table with `use` and parameters."""
    table = table_of(text)
    use, place = table.pop("use", ""), table.pop("folder", "")
    return Plugin(use=use, folder=place or folder, parameters=tuple(sorted(table.items())))


def made(registry: Registry[Any], plugin: Plugin) -> Any:
    """Return the plugged-in function, or an instance of the class with its parameters; PluginError without one."""
    found = registry.resolve(plugin.use, plugin.folder)
    given = dict(plugin.parameters)
    if not isinstance(found, type):
        if given:
            raise PluginError(f"{plugin.use} is a function and takes no parameters; leave out {', '.join(given)}")
        return found
    try:
        values = parameter_values(found, given)
        if any("__init__" in vars(base) for base in found.__mro__ if base is not object):
            return found(**values)
        it = found()
        for name, value in values.items():
            setattr(it, name, value)
    except ANYTHING as error:  # its __init__ is foreign code
        text = printable(str(error), 300) if type(error) is ValueError else named(error)
        raise PluginError(f"{plugin.use} cannot be made: {text}") from error
    return it


def plugin_problems(registry: Registry[Any], plugin: Plugin) -> list[Problem]:
    try:
        found = registry.resolve(plugin.use, plugin.folder)
    except PluginError as error:
        return [Problem("", str(error))]
    if isinstance(found, type) and (wrong := read_parameters(found, dict(plugin.parameters))[1]):
        return wrong
    try:
        made(registry, plugin)
    except PluginError as error:
        return [Problem("", str(error))]
    return []


def class_objection(it: Any, base: type, method: str, arguments: tuple[str, ...], keys: tuple[str, ...] = KEYS) -> str:
    """Return why something is no class of a kind, "" if it is.

    It is to define the method of `base` with these arguments, and none of its parameters may be named as one of `keys`.
    """
    if not (isinstance(it, type) and issubclass(it, base)):
        return f"derive a class from gridpeers.{base.__name__}"
    call = f"{method}({', '.join(('self', *arguments))})"
    if getattr(it, method) is getattr(base, method):
        return f"it has no method {call}"
    wrong = _call_objection(getattr(it, method), 1 + len(arguments))
    return f"write its method {call}: {wrong}" if wrong else parameter_objection(it, keys)


def callable_objection(it: Any, argument: str, keys: tuple[str, ...] = KEYS) -> str:
    """Return why something is neither a function of one argument nor a class of such functions; "" if it is."""
    if isinstance(it, type):
        method = next((vars(base)["__call__"] for base in it.__mro__ if "__call__" in vars(base)), None)
        if method is None:
            return f"the class needs a method __call__(self, {argument})"
        wrong = _call_objection(method, 2)
        return f"write its method __call__(self, {argument}): {wrong}" if wrong else parameter_objection(it, keys)
    if not callable(it):
        return f"write a function of the {argument}, or a class with a method __call__(self, {argument})"
    wrong = _call_objection(it, 1)
    return f"it is called with one argument, the {argument}: {wrong}" if wrong else ""


def _call_objection(function: Any, arguments: int) -> str:
    try:
        inspect.signature(function).bind(*[None] * arguments)
    except TypeError as error:
        return str(error)
    except ValueError:  # a function of C tells no signature
        pass
    return ""


def parameter_objection(cls: type, taken: tuple[str, ...] = ()) -> str:
    """Return why a class cannot have its parameters, "" if it can; `taken` are names that mean something else."""
    try:
        fields = fields_of(cls)
    except TypeError as error:
        return str(error)
    for field in fields:
        if field.name in taken:
            return (
                f"its parameter {field.name} cannot be given, as a scenario has the key {field.name} for something "
                "else; give it another name"
            )
        if field.required:
            continue
        try:
            wrong = field.objection(msgspec.convert(field.default, field.type))
        except msgspec.ValidationError:
            wrong = f"must be {in_words(field.type)}, got {shown(field.default)}"
        if wrong:
            return f"{cls.__name__}.{field.name}: its default {wrong}"
    return ""
