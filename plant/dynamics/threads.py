"""Threads of the plant's numbers: linear algebra has one, so that bytes are the same; islands have one a core."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Thread
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
    """Return what `work` gives for each item, in their order; raise the first item's error, if any.

    Threads pay where `work` spends its time without Python's lock. What it gives must not depend on the other items.
    """
    waiting = deque(range(len(items)))
    results: dict[int, R] = {}
    errors: dict[int, BaseException] = {}

    def take() -> None:
        while waiting:
            try:
                k = waiting.popleft()
            except IndexError:  # another thread was faster
                return
            try:
                results[k] = work(items[k])
            except BaseException as error:
                errors[k] = error

    threads = [Thread(target=take, daemon=True) for _ in range(min(usable_cores(), MOST_THREADS, len(items)) - 1)]
    for thread in threads:
        thread.start()
    take()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[min(errors)]
    return [results[k] for k in range(len(items))]
