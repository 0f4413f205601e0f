"""One thread for linear algebra, so that bytes are the same on any number of cores."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import scipy.linalg  # noqa: F401 - the controller knows the libraries that are loaded when it is made
from threadpoolctl import ThreadpoolController

_LIBRARIES = ThreadpoolController().select(user_api="blas").lib_controllers
_lock = threading.Lock()
_before: list[int] = []  # threads of each library before the first run
_inside = 0


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold BLAS to one thread, together with all other runs in this context; also a decorator, `@one_thread()`."""
    global _inside
    with _lock:
        if _inside == 0:
            _before[:] = [library.num_threads for library in _LIBRARIES]
        _set([1] * len(_LIBRARIES))  # in each thread: with OpenMP the limit is the thread's
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _set(_before)


def _set(threads: list[int]) -> None:
    """Set the limits; threadpoolctl itself accepts those of OpenBLAS from one thread alone, and ignores the others."""
    for library, number in zip(_LIBRARIES, threads, strict=True):
        getattr(library, "_real_set_num_threads", library.set_num_threads)(number)
