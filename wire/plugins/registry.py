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
from importlib.machinery import PathFinder, SourceFileLoader
from importlib.util import find_spec
from traceback import walk_tb
from types import ModuleType
from typing import Any, Generic, TypeVar

from gridpeers.wire.wording import InputError, is_no_path, printable, suggestion

T = TypeVar("T")

_changed: dict[str, float] = {}  # When the file of each module in a scenario's folder was last changed, at its import

NOTEBOOK = "__main__"
"""Module of what is defined in a notebook or in the script that runs: no other process can import it."""

ANYTHING = (Exception, SystemExit, GeneratorExit)
"""Exceptions of foreign code; only Ctrl+C and a request to stop end the run."""

LONGEST_NAME = 100  # Characters of the name of a file that a message shows


def named(error: BaseException) -> str:
    """Return an error as one line; its text may fail too."""
    try:
        text = str(error)
    except ANYTHING:
        text = "its text cannot be read"
    return printable(f"{type(error).__name__}: {text}", 200)


def line_of(function: Callable[..., Any], error: BaseException, folder: str = "") -> str:
    """Return where foreign code failed, as " (mine.py:12)": the innermost line in the folder of a function's file.

    Without a traceback, as of a function that returned something wrong, it is the line of the function. A file in
    `folder`, by default that of the function, is named from there. Empty for a function that is not written in Python.
    """
    of_instance = getattr(type(function), "__call__", None)  # noqa: B004 - its code is wanted
    code = getattr(function, "__code__", None) or getattr(of_instance, "__code__", None)
    if code is None:
        return ""
    file, line, home = code.co_filename, code.co_firstlineno, code.co_filename.rpartition("/")[0]
    for frame, number in walk_tb((error.__cause__ or error).__traceback__):
        if frame.f_code.co_filename.rpartition("/")[0] == home:
            file, line = frame.f_code.co_filename, number
    return f" ({printable(file.removeprefix(f'{folder or home}/'), LONGEST_NAME)}:{line})"


class PluginError(InputError):
    """A reference that leads to nothing usable; its text says why and what to write."""


class Registry(Generic[T]):
    """Everything of one kind that can be plugged in.

    `kind` and `plural` are the words for it, `objection` says why an object is none of this kind, as the end of a
    sentence, and `own` has the references of those that come with gridpeers, imported when they are asked for. Names of
    entry points that are `reserved` no decorator takes over.
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
        return f"gridpeers.{self.plural.replace(' ', '_')}"

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.own, *self._added, *entry_points_of(self.group))))

    def register(self, name: str) -> Callable[[T], T]:
        """Return a decorator that gives a part its name in this process; a PluginError refuses a taken name."""
        if not isinstance(name, str) or not name.strip() or ":" in name:
            raise PluginError(
                f'{name!r:.60} is no name of a {self.kind}; give the decorator a text without ":", e.g. "mine"'
            )

        def add(it: T) -> T:
            before = self._added.get(name, it)  # a cell of a notebook that runs again adds the same once more
            if name in self.own or name in self._reserved or _home(before) != _home(it):
                raise PluginError(f'there is a {self.kind} "{name}" already; choose another name')
            self._check(it, name)
            self._added[name] = it
            return it

        return add

    def resolve(self, reference: str, folder: str = "") -> T:
        """Return the object of a name, or of `module:Name`, also from a `folder` that is not on the Python path.

        Raise PluginError if there is none, or it is none of this kind.
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

        Raise PluginError if it is defined in a notebook or script, where no other process can import it.
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
        module = sys.modules[NOTEBOOK] if module_name == NOTEBOOK else _module(module_name, reference, folder)
        found: Any = module
        for part in filter(None, name.split(".")):  # a module alone, where a registry takes modules
            try:
                found = getattr(found, part)
            except AttributeError:
                there = [
                    key for key, value in vars(module).items() if not key.startswith("_") and not self._objection(value)
                ]
                hint = suggestion(part, there, "names there")
                raise PluginError(f'{reference}: module {module_name} has no "{part}"; {hint}') from None
        self._check(found, reference)
        return found  # type: ignore[no-any-return]

    def _check(self, it: Any, reference: str) -> None:
        if why := self._objection(it):
            raise PluginError(f"{reference} is no {self.kind}: {why}")


def _module(name: str, reference: str, folder: str) -> ModuleType:
    """Import a module from the Python path, or else from a folder, which the path then has at its end."""
    top = name.partition(".")[0]
    meant = PathFinder.find_spec(top, [folder]) if folder else None
    if meant is not None and folder not in sys.path:
        there = PathFinder.find_spec(top)
        if there is None or there.origin != meant.origin:  # "" on the path is the folder where a session runs
            sys.path.append(folder)  # at the end: a module of the user's never hides one of gridpeers or of Python
    try:
        if name not in sys.modules and find_spec(name) is None:
            place = f" in {folder} or" if folder else ""
            raise PluginError(
                f'{reference}: there is no module "{name}"{place} on the Python path; write module:Name, e.g. mine:Mine'
            )
        module = importlib.import_module(name)
        found = getattr(sys.modules[top], "__spec__", None)
        if meant is not None and found is not None and meant.origin != found.origin:
            raise PluginError(
                f"{reference}: Python has another module {top}, from {found.origin}, than that in {folder}; give one "
                "of them another name"
            )
        return module if meant is None else _as_it_is_now(module)
    except PluginError:
        raise
    except ANYTHING as error:  # whatever a user's module does while it is imported
        raise PluginError(f"{reference}: importing {name} failed: {named(error)}") from error


def _as_it_is_now(module: ModuleType) -> ModuleType:
    """Return a module of the user's, imported again if its file was edited since, as between two runs of a notebook."""
    spec = module.__spec__
    if spec is None or not isinstance(spec.loader, SourceFileLoader):
        return module
    changed = spec.loader.path_stats(spec.loader.path)["mtime"]
    if _changed.setdefault(module.__name__, changed) == changed:
        return module
    _changed[module.__name__] = changed
    return importlib.reload(module)


def _home(it: Any) -> tuple[str, str]:
    kind = it if hasattr(it, "__qualname__") else type(it)
    return str(kind.__module__), str(kind.__qualname__)


@cache
def entry_points_of(group: str) -> dict[str, str]:
    """References of a group's entry points, by name."""
    from importlib import metadata  # a quarter of an agent's start, which resolves names of our own alone

    return {point.name: point.value for point in metadata.entry_points(group=group)}


def folder_of(reference: str, folder: str) -> str:
    """Return where another process finds the module of a reference: `folder` if it is there, else its own folder."""
    top = reference.partition(":")[0].partition(".")[0]
    if top == NOTEBOOK or is_no_path(folder) or is_no_path(f"{top}.py") or PathFinder.find_spec(top, [folder]):
        return folder
    try:
        spec = find_spec(top)
    except ValueError:  # a module without a specification, as of an embedded interpreter
        return folder
    if spec is None or spec.origin is None or spec.origin == "frozen":
        return folder
    place = spec.origin.rpartition("/")[0]
    return place.rpartition("/")[0] if spec.submodule_search_locations else place
