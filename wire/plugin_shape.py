"""Whether an object has the shape of a plug-in: a class with a method, or a function of one argument. Pure."""

from __future__ import annotations

import inspect
from typing import Any

from wire.parameters import parameter_objection

KEYS = ("use", "folder")
"""Keys of a plug-in's table that are no parameters of it."""


def class_objection(it: Any, base: type, method: str, arguments: tuple[str, ...], keys: tuple[str, ...] = KEYS) -> str:
    """Return why something is no class of a kind, "" if it is.

    Parameters
    ----------
    it : Any
        What somebody has written.
    base : type
        What it is derived from; `gridpeers` has it under its name.
    method : str
        What it must define.
    arguments : tuple[str, ...]
        Arguments of the method, without self.
    keys : tuple[str, ...], optional
        Names that its parameters cannot have.

    Examples
    --------
    >>> class Base:
    ...     def judge(self, message): ...
    >>> class Mine(Base):
    ...     def judge(self): ...
    >>> class_objection(Base, Base, "judge", ("message",))
    'it has no method judge(self, message)'
    >>> class_objection(Mine, Base, "judge", ("message",))
    'write its method judge(self, message): too many positional arguments'
    """
    if not (isinstance(it, type) and issubclass(it, base)):
        return f"derive a class from gridpeers.{base.__name__}"
    call = f"{method}({', '.join(('self', *arguments))})"
    if getattr(it, method) is getattr(base, method):
        return f"it has no method {call}"
    try:
        inspect.signature(getattr(it, method)).bind(None, *arguments)
    except TypeError as error:
        return f"write its method {call}: {error}"
    return parameter_objection(it, keys)


def callable_objection(it: Any, argument: str, keys: tuple[str, ...] = KEYS) -> str:
    """Return why something is no function, nor class of functions, of one argument; "" if it is.

    Examples
    --------
    >>> callable_objection(len, "window"), callable_objection(lambda: 1, "window")
    ('', 'it is called with one argument, the window: too many positional arguments')
    """
    if isinstance(it, type):
        call = next((vars(base)["__call__"] for base in it.__mro__ if "__call__" in vars(base)), None)
        if call is None:
            return f"the class needs a method __call__(self, {argument})"
        try:
            inspect.signature(call).bind(None, None)
        except TypeError as error:
            return f"write its method __call__(self, {argument}): {error}"
        return parameter_objection(it, keys)
    if not callable(it):
        return f"write a function of the {argument}, or a class with a method __call__(self, {argument})"
    try:
        inspect.signature(it).bind(None)
    except TypeError as error:
        return f"it is called with one argument, the {argument}: {error}"
    except ValueError:  # a function of C tells no signature
        return ""
    return ""
