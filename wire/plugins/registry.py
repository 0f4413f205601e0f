"""Registries: what a user can plug in, found by a registered name, an entry point, or `module:Name`.

A registry knows its own objects, those that a decorator has added in this process, and those of installed distributions
(entry points of its group). A reference `module:Name` needs no registration: the module is imported from the Python
path, or from the folder of the scenario that names it. So another process finds the same object from the same text.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Collection
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec
from types import ModuleType
from typing import Any, Generic, TypeVar

from gridpeers.wire.plugins.foreign_code import foreign_code
from gridpeers.wire.wording import printable, suggestion

T = TypeVar("T")

_folders: set[str] = set()
"""Folders of scenarios that registries have put on the Python path of this process."""

_changed: dict[str, int] = {}
"""When the file of each module from there was changed last (ns), as of its import."""

NOTEBOOK = "__main__"
"""Module of what is defined in a notebook or in the script that runs: no other process can import it."""


class PluginError(ValueError):
    """A reference that leads to nothing usable; its text says why and what to write."""


class Registry(Generic[T]):
    """Everything of one kind that can be plugged in.

    Parameters
    ----------
    kind, plural : str
        What is registered, for messages: "law", "laws".
    objection : Callable[[Any], str]
        Why an object is none of this kind, as the end of a sentence; "" if it is one.
    own : dict[str, str], optional
        References (`module:Name`) of those that come with gridpeers, by name; imported when they are asked for.
    reserved : Collection[str], optional
        Names of entry points of gridpeers that no decorator may take over.

    Examples
    --------
    >>> greetings = Registry("greeting", "greetings", lambda it: "" if callable(it) else "it cannot be called",
    ...     own={"print": "builtins:print"})
    >>> @greetings.register("hello")
    ... def hello(): return "hello"
    >>> greetings.resolve("hello") is hello, greetings.resolve("print") is print, greetings.names
    (True, True, ('print', 'hello'))
    >>> greetings.resolve("helo")
    Traceback (most recent call last):
        ...
    gridpeers.wire.plugins.registry.PluginError: there is no greeting "helo"; did you mean "hello"? The greetings ...
    """

    def __init__(
        self,
        kind: str,
        plural: str,
        objection: Callable[[Any], str],
        own: dict[str, str] | None = None,
        reserved: Collection[str] = (),
    ) -> None:
        self.kind, self.plural = kind, plural
        self._objection = objection
        self.own, self._reserved = dict(own or {}), reserved
        self._added: dict[str, T] = {}

    @property
    def group(self) -> str:
        """Group of entry points by which an installed distribution adds to this registry."""
        return f"gridpeers.{self.plural.replace(' ', '_')}"

    @property
    def names(self) -> tuple[str, ...]:
        """Names that can be resolved, gridpeers' own first."""
        return tuple(dict.fromkeys((*self.own, *self._added, *entry_points_of(self.group))))

    def register(self, name: str) -> Callable[[T], T]:
        """Return a decorator that adds an object under a name, for this process; a name is never taken over.

        Raises
        ------
        PluginError
            If gridpeers, or another module, has an object of this name, or it is no name.
        """
        if not isinstance(name, str) or not name.strip() or ":" in name:
            raise PluginError(
                f'{name!r:.60} is no name of a {self.kind}; give the decorator a text without ":", e.g. "mine"'
            )

        def add(it: T) -> T:
            before = self._added.get(name)
            same = before is not None and _home(before) == _home(it)  # a cell of a notebook that is run again
            if name in self.own or name in self._reserved or (before is not None and not same):
                raise PluginError(f'there is a {self.kind} "{name}" already; choose another name')
            self._check(it, name)
            self._added[name] = it
            return it

        return add

    def resolve(self, reference: str, folder: str = "") -> T:
        """Return the object of a name, or of `module:Name`, also from a `folder` that is not on the Python path.

        Raises
        ------
        PluginError
            If there is none, or it is none of this kind.
        """
        if reference in self._added:
            return self._added[reference]
        if reference in self.own:
            return self._imported(self.own[reference], "")
        if reference in entry_points_of(self.group):
            return self._imported(entry_points_of(self.group)[reference], "")
        if ":" in reference:
            return self._imported(reference, folder)
        text = f'there is no {self.kind} "{reference}"; {suggestion(reference, self.names, self.plural)}'
        raise PluginError(f"{text}; your own is written module:Name")

    def reference(self, name: str) -> str:
        """Return `module:Name` of what a decorator has added in this process; every other text as it is."""
        return ":".join(_home(self._added[name])) if name in self._added else name

    def name_of(self, it: object) -> str:
        """Return the name under which a decorator has added an object in this process; "" if none has."""
        return next((name for name, known in self._added.items() if known is it), "")

    def portable(self, reference: str) -> str:
        """Return the text by which another process finds the same object: `module:Name` for what a decorator added.

        Raises
        ------
        PluginError
            If it is defined in a notebook or script, where no other process can import it.
        """
        text = self.reference(reference)
        module, _, name = text.partition(":")
        if name and module == NOTEBOOK:
            raise PluginError(
                f"the {self.kind} {name} is defined in a notebook or in the script that runs, where other processes "
                f'cannot import it; move it to a module, or run with driver="inprocess"'
            )
        return text

    def _imported(self, reference: str, folder: str) -> T:
        module_name, _, name = reference.partition(":")
        if module_name == NOTEBOOK:
            module: Any = sys.modules[NOTEBOOK]
        else:
            module = self._module(module_name, reference, folder)
        found = module
        for part in filter(None, name.split(".")):  # a module alone, where a registry takes modules
            try:
                found = getattr(found, part)
            except AttributeError:
                there = [key for key, value in vars(module).items() if not key.startswith("_") and self._fits(value)]
                hint = suggestion(part, there, "names there")
                raise PluginError(f'{reference}: module {module_name} has no "{part}"; {hint}') from None
        self._check(found, reference)
        return found  # type: ignore[no-any-return]

    def _module(self, name: str, reference: str, folder: str) -> Any:
        if folder and folder not in sys.path and _is_needed(name, folder):
            sys.path.append(folder)  # at the end: a module of the user's never hides one of gridpeers or of Python
            _folders.add(folder)
        try:
            known = name in sys.modules
            spec = sys.modules[name].__spec__ if known else find_spec(name)
            if (spec is None and not known) or is_of_another(spec, folder):
                place = f" in {folder} or" if folder else ""
                text = f'there is no module "{name}"{place} on the Python path; write module:Name, e.g. mine:Mine'
                raise PluginError(f"{reference}: {text}")
            with foreign_code():
                found = importlib.import_module(name)
            _check_place(found, name, folder, reference)
            return _as_it_is_now(found)
        except PluginError:
            raise
        except (Exception, SystemExit) as error:  # whatever a user's module does while it is imported
            text = printable(f"{type(error).__name__}: {error}", 300)
            raise PluginError(f"{reference}: importing {name} failed: {text}") from error

    def _fits(self, it: Any) -> bool:
        return not self._objection(it)

    def _check(self, it: Any, reference: str) -> None:
        if why := self._objection(it):
            raise PluginError(f"{reference} is no {self.kind}: {why}")


def _is_needed(name: str, folder: str) -> bool:
    """Whether a module stands in a folder that Python would not look in, nor by "", which is where a session runs."""
    top = name.partition(".")[0]
    meant, found = PathFinder.find_spec(top, [folder]), PathFinder.find_spec(top)
    return meant is not None and (found is None or found.origin is None or found.origin != meant.origin)


def _check_place(module: Any, name: str, folder: str, reference: str) -> None:
    """Refuse a module of the same name as the one in a scenario's folder that is another."""
    top = sys.modules[name.partition(".")[0]]
    found = getattr(top, "__spec__", None)
    meant = PathFinder.find_spec(top.__name__, [folder]) if folder else None
    if found is None or meant is None or meant.origin == found.origin or _source(meant) == _source(found):
        return
    raise PluginError(
        f"{reference}: Python has another module {top.__name__}, from {found.origin}, than that in {folder}; give one "
        "of the two another name"
    )


def is_of_another(spec: ModuleSpec | None, folder: str) -> bool:
    """Whether a module stands in the folder of another scenario: only this process would find it there."""
    place = "" if spec is None or not spec.has_location or not spec.origin else spec.origin.rpartition("/")[0]
    own = spec is not None and folder and PathFinder.find_spec(spec.name.partition(".")[0], [folder])
    return place in _folders and place != folder and not own


def _as_it_is_now(module: ModuleType) -> ModuleType:
    """Return a module from the folder of a scenario, imported again if its file has changed since."""
    spec, name = module.__spec__, module.__name__
    if spec is None or not spec.origin or spec.origin.rpartition("/")[0] not in _folders:
        return module
    loader: Any = spec.loader
    when = int(loader.path_stats(spec.origin)["mtime"] * 1e9)
    if _changed.setdefault(name, when) != when:
        _changed[name] = when
        return importlib.reload(module)
    return module


def _source(spec: Any) -> str | None:
    """Text of a module, by which the same file is known under another path."""
    text = getattr(spec.loader, "get_source", lambda name: None)(spec.name)
    return None if text is None else str(text)


def _home(it: Any) -> tuple[str, str]:
    """Module and name under which an object can be imported."""
    kind = it if hasattr(it, "__qualname__") else type(it)
    return str(kind.__module__), str(kind.__qualname__)


@cache
def entry_points_of(group: str) -> dict[str, str]:
    """References of a group's entry points, by name."""
    from importlib import metadata  # a quarter of an agent's start, which resolves names of our own alone

    return {point.name: point.value for point in metadata.entry_points(group=group)}
