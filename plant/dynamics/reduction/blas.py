"""Hold linear algebra to one thread in this process while any run needs it.

With more threads its sums have another order: another number of cores would give other last digits, and the same run
other bytes. The limit is of the whole process. Where several threads have a run each, as in a notebook or a worker of
Dask, the first one to finish would lift it under the others. So the first sets it, and the last lifts it.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import scipy.linalg  # noqa: F401 - the controller knows the libraries that are loaded when it is made
from threadpoolctl import ThreadpoolController

_LIBRARIES = ThreadpoolController().select(user_api="blas").lib_controllers
_lock = threading.Lock()
_before: list[int] = []
"""Threads of each library before the first run."""
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
