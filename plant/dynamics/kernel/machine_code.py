"""Machine code on disk: read it, link it into this process by llvmlite, and call it.

This needs no numba. A file of it is for one function, the types of its arguments, one processor and one version of
numba; it begins with a hash of its name and the rest, so that half a file is none, nor one under another's name.
"""

from __future__ import annotations

import ctypes
import errno
import os
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from importlib import metadata
from itertools import count
from pathlib import Path
from struct import Struct
from typing import Any, NamedTuple

SUFFIX = ".code"

_WORDS = {"i": "q", "b": "q", "f": "d", "c": "dd"}
"""Words of a result by its type: integer, truth value, number, complex number."""

_numbers = count()
_linker: Any = None


class MachineCode(NamedTuple):
    """A function as machine code that can be linked.

    Its function has four pointers as its arguments: to what it returns and raises inside of numba, which nobody reads;
    to the words of `call_arguments`; and to room for the words of its results.
    """

    symbol: str
    """Its name."""
    results: str
    """Types of what it returns: a letter each; in brackets where it is a tuple; "" for None."""
    code: bytes
    """Object file."""

    @classmethod
    def read(cls, file: Path) -> MachineCode | None:
        """Return the code that a file keeps; None if there is none, or not the whole of it."""
        try:
            digest, _, rest = file.read_bytes().partition(b"\n")
        except OSError:
            return None
        if digest.decode(errors="replace") != _digest(file, rest):
            return None
        symbol, results, code = rest.split(b"\n", 2)
        return cls(symbol.decode(), results.decode(), code)

    def keep(self, file: Path) -> None:
        """Write it into a file, whole or not at all; where nothing can be written it is compiled anew next time."""
        rest = f"{self.symbol}\n{self.results}\n".encode() + self.code
        part = file.with_name(f"{file.name}-{os.getpid()}")
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            part.write_bytes(_digest(file, rest).encode() + b"\n" + rest)
            part.replace(file)
        except OSError:
            with suppress(OSError):
                part.unlink(missing_ok=True)

    def linked(self, name: str, *, locked: bool) -> Callable[[bytes], Any]:
        """Link it into this process; return the function from words to results.

        Parameters
        ----------
        name : str
            Name of the function for errors.
        locked : bool
            Whether calls keep Python's lock, so that no other thread runs.

        Raises
        ------
        RuntimeError
            If it calls what this process does not have.
        """
        binding = _llvm()
        global _linker
        if _linker is None:
            _linker = new_linker()
        library = binding.JITLibraryBuilder().add_object_img(self.code).add_current_process().export_symbol(self.symbol)
        tracker = library.link(_linker, f"{self.symbol}-{next(_numbers)}")
        kind = ctypes.PYFUNCTYPE if locked else ctypes.CFUNCTYPE
        pointers = ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p
        return _caller(name, kind(ctypes.c_int32, *pointers)(tracker[self.symbol]), self.results, tracker)


def _digest(file: Path, rest: bytes) -> str:
    """Return the hash of a file's content and name: under another name it is the code of something else."""
    return sha256(file.name.encode() + b"\n" + rest).hexdigest()


def new_linker() -> Any:
    """Return a linker for this processor."""
    binding = _llvm()
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.create_lljit_compiler(suppress_errors=True)


def file_name(function: str, types: str) -> str:
    """Return the name of the file for a function, the types of its arguments, this processor, and this numba."""
    binding = _llvm()
    parts = (
        *(function, types, binding.get_process_triple(), binding.get_host_cpu_name()),
        *(binding.get_host_cpu_features().flatten(), metadata.version("numba"), metadata.version("llvmlite")),
    )
    return f"{function.rpartition('.')[2]}-{sha256(repr(parts).encode()).hexdigest()[:24]}{SUFFIX}"


def _llvm() -> Any:
    """Return llvmlite's binding; where the system has no memory for its library, which llvmlite does not say, say so.

    Raises
    ------
    OSError
        With `errno.ENOMEM` there.
    """
    try:
        from llvmlite import binding
    except OSError as error:
        if "failed to map segment" in str(error.__context__):  # of the dynamic linker, without a number
            raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM), "libllvmlite.so") from error
        raise
    return binding


def _caller(name: str, function: Any, results: str, alive: Any) -> Callable[[bytes], Any]:
    """Return the function from words to results, which keeps the linked code `alive`."""
    letters = results.strip("()")
    unpack = Struct("".join(_WORDS[letter] for letter in letters)).unpack_from
    room = ctypes.c_int64 * (2 * len(letters) + 1)
    unread = (ctypes.c_void_p * 8)()

    def call(words: bytes) -> Any:
        found = room()
        status = function(unread, unread, words, found)
        if status != 0:
            raise RuntimeError(f"{name}: the compiled function failed with status {status} of numba, in {alive.name}")
        if not letters:
            return None
        values = unpack(found)
        if results == letters and letters in "if":
            return values[0]
        given = _converted(letters, list(values))
        return tuple(given) if results != letters else given[0]

    return call


def _converted(letters: str, values: list[Any]) -> list[Any]:
    """Return the results of these types from their words."""
    given: list[Any] = []
    for letter in letters:
        value = values.pop(0)
        given.append(complex(value, values.pop(0)) if letter == "c" else bool(value) if letter == "b" else value)
    return given
