"""What a scenario says of something plugged in: its name or reference, where its module is, and its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import msgspec

from wire.anybody import ANYTHING, named
from wire.parameters import objections, values_of
from wire.printable import printable
from wire.registry import PluginError, Registry

Scalar = float | int | bool | str
"""Value of a parameter."""


def scalar_objection(value: Any) -> str:
    """Return why a value cannot be one of a parameter, whatever the parameter; "" if it can.

    Examples
    --------
    >>> scalar_objection(10**30)
    'a whole number has at most 64 bits; got 1000000000000000000000000000000'
    """
    shown = printable(repr(value), 60)
    if not isinstance(value, str | int | float):
        return f"a parameter is a number, a text, or true or false; got {shown}"
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return f"a whole number has at most 64 bits; got {shown}"
    if isinstance(value, float) and not isfinite(value):
        return f"must be a finite number, got {shown}"
    return ""


class Plugin(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A function, or a class with parameters, of a registry."""

    use: str
    """Registered name, or `module:Name`."""
    folder: str = ""
    """Where the module is looked for."""
    parameters: tuple[tuple[str, Scalar], ...] = ()
    """Name and value of those that do not keep their default, in the order of the names."""

    @property
    def name(self) -> str:
        """The plugin, for people; the same text in every process."""
        return self.use


def table_of(key: str | Mapping[str, Any]) -> dict[str, Any]:
    """Return a scenario's key as a table, a copy: a text alone is its `use`.

    Examples
    --------
    >>> table_of("mine:Nearest")
    {'use': 'mine:Nearest'}
    """
    return {"use": key} if isinstance(key, str) else dict(key)


def plugin_of(text: str | Mapping[str, Any], folder: str = "") -> Plugin:
    """Return what a scenario's key says: a text, or a table with `use` and parameters.

    Examples
    --------
    >>> plugin_of({"use": "mine:Nearest", "k": 3}).parameters
    (('k', 3),)
    """
    table = table_of(text)
    use, place = table.pop("use", ""), table.pop("folder", "")
    return Plugin(use=use, folder=place or folder, parameters=tuple(sorted(table.items())))


def made(registry: Registry[Any], plugin: Plugin) -> Any:
    """Return the plugged-in function, or an instance of the class with its parameters.

    Raises
    ------
    PluginError
        If there is none, or it cannot be made with these parameters; the text says what would be right.
    """
    found = registry.resolve(plugin.use, plugin.folder)
    given = dict(plugin.parameters)
    if not isinstance(found, type):
        if given:
            raise PluginError(f"{plugin.name} is a function and takes no parameters; leave out {', '.join(given)}")
        return found
    try:
        values = values_of(found, given)
        if any("__init__" in vars(base) for base in found.__mro__ if base is not object):
            return found(**values)
        it = found()
        for name, value in values.items():
            setattr(it, name, value)
    except ANYTHING as error:  # its __init__ is anybody's code
        text = printable(str(error), 300) if type(error) is ValueError else named(error)
        raise PluginError(f"{plugin.name} cannot be made: {text}") from error
    return it


def plugin_problems(registry: Registry[Any], plugin: Plugin) -> list[tuple[str, str]]:
    """Return all that is wrong with a plugin: for each the parameter, "" for the whole, and a sentence."""
    try:
        found = registry.resolve(plugin.use, plugin.folder)
    except PluginError as error:
        return [("", str(error))]
    if isinstance(found, type) and (wrong := objections(found, dict(plugin.parameters))):
        return wrong
    try:
        made(registry, plugin)
    except PluginError as error:
        return [("", str(error))]
    return []
