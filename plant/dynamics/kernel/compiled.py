"""How the plant's inner loop is compiled: by numba once, and from machine code on disk ever after.

To load numba and what its own cache keeps takes 0.6 s, twice as long as a case in one process. So the machine code of
each function that Python calls is kept as it is (`machine_code`), and numba is imported only where some is missing.
It is kept in the user's cache folder. Where that cannot be written, each process compiles for itself.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

from plant.dynamics.kernel.call_arguments import UnpackableError, described, pack
from plant.dynamics.kernel.machine_code import SUFFIX, MachineCode, file_name

_P = ParamSpec("_P")
_R = TypeVar("_R")

_HERE = Path(__file__).parent


def kernel_folders() -> tuple[Path | None, Path]:
    """Return where machine code of these sources is kept, and where a packager may have put it: beside the sources.

    The first is `NUMBA_CACHE_DIR`, or the user's cache; None where the user has no home. An edit of `gfm.py` changes
    the code of its callers in `step.py`, so the name of both folders carries a hash of all files here.
    """
    digest = hashlib.sha256()
    for source in sorted(_HERE.glob("*.py")):
        digest.update(source.read_bytes())
    name = f"kernels-{digest.hexdigest()[:16]}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    base = Path(chosen) if chosen else user_cache()
    return base / name if base else None, _HERE / "__pycache__" / name


def user_cache() -> Path | None:
    """Return the user's cache folder for gridpeers, as the system has it; None where the user has no home."""
    if os.name == "nt":
        variable, within = "LOCALAPPDATA", "AppData/Local"
    else:
        variable, within = "XDG_CACHE_HOME", "Library/Caches" if sys.platform == "darwin" else ".cache"
    try:
        folder = Path(os.environ.get(variable) or Path.home() / within)
    except RuntimeError:  # no HOME, and no entry in the list of users
        return None
    return folder / "gridpeers" if folder.is_absolute() else None


FOLDER, BESIDE = kernel_folders()
"""Where machine code of these sources is kept, and where it may be too."""


def read_code(file: str) -> MachineCode | None:
    """Return the machine code of a file's name; None if no folder has it."""
    found = (MachineCode.read(folder / file) for folder in (FOLDER, BESIDE) if folder)
    return next(filter(None, found), None)


def is_compiled(function: str) -> bool:
    """Whether machine code of a function is on disk."""
    return any(True for folder in (FOLDER, BESIDE) if folder for _ in folder.glob(f"{function}-*{SUFFIX}"))


class Kernel(Generic[_P, _R]):
    """A function that runs as machine code, called as it is written.

    Parameters
    ----------
    function : Callable
        What numba can compile; functions of ours that it calls are `Kernel`s too.
    locked : bool, optional
        Whether calls keep Python's lock.
    """

    def __init__(self, function: Callable[_P, _R], *, locked: bool = True) -> None:
        self.__name__, self.__doc__, self.__module__ = function.__name__, function.__doc__, function.__module__
        self.function = function
        self._locked = locked
        self._linked: dict[tuple[Any, ...], Callable[[bytes], Any] | None] = {}
        """By the kinds of arguments; None where numba calls it."""
        self._dispatcher: Any = None

    def __call__(self, *args: _P.args, **named: _P.kwargs) -> _R:
        """Call it; the first call with arguments of its types links the machine code, or compiles it."""
        try:
            kinds, words = pack(args)
        except UnpackableError:  # a record by itself, for instance: tests call a model so
            return self._by_numba(*args, **named)
        if named:
            return self._by_numba(*args, **named)
        try:
            linked = self._linked[kinds]
        except KeyError:
            linked = self._linked[kinds] = self._link(args, described(kinds))
        if linked is None:
            return self._by_numba(*args)
        result: _R = linked(words)
        return result

    def _link(self, args: tuple[Any, ...], types: str) -> Callable[[bytes], Any] | None:
        """Link the machine code for arguments of these types, compiled first where there is none on disk."""
        file = file_name(f"{self.function.__module__}.{self.function.__name__}", types)
        code = read_code(file)
        try:
            if code is None:
                from plant.dynamics.kernel.compiling import compile_call

                code = compile_call(self.dispatcher, args)
                if FOLDER:
                    code.keep(FOLDER / file)
            return code.linked(self.__name__, locked=self._locked)
        except RuntimeError:  # of llvmlite: on a system, or with a version of it, where this was never tried
            return None

    def _by_numba(self, *args: Any, **named: Any) -> _R:
        result: _R = self.dispatcher(*args, **named)
        return result

    @property
    def dispatcher(self) -> Any:
        """The function as numba compiles it; the functions of ours that it calls are given to numba likewise."""
        if self._dispatcher is None:
            from plant.dynamics.kernel.compiling import dispatcher_of

            self._dispatcher, namespace = dispatcher_of(self.function, FOLDER)
            seen = {name: each.dispatcher for name, each in namespace.items() if isinstance(each, Kernel)}
            namespace.update(seen)
        return self._dispatcher


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile a function at its first call and keep the machine code on disk.

    No fast-math: sums keep their order, so the same inputs give the same bytes in every process.
    """
    return Kernel(function)


def unlocked(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return a compiled function in a form that other threads run beside: by the same machine code."""
    assert isinstance(function, Kernel)
    return Kernel(function.function, locked=False)
