"""Threads of the plant's numbers: linear algebra has one, so that bytes are the same; islands have one a core."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

import scipy.linalg  # noqa: F401 - the controller knows the libraries that are loaded when it is made
from threadpoolctl import ThreadpoolController

from gridpeers.wire.driver.machine import usable_cores

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


T = TypeVar("T")
R = TypeVar("R")

MOST_THREADS = 4  # threads, as far as there are cores: more of them share one path to the memory


def each_on_a_core(work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Return the result of `work` for each item, in order. Threads pay where it needs no lock of Python."""
    with ThreadPoolExecutor(min(usable_cores(), MOST_THREADS)) as pool:
        return list(pool.map(work, items))
