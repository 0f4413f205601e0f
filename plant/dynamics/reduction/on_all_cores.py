"""Several pieces of compiled work at the same time: one thread a core, for as long as the work takes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from threading import Thread
from typing import TypeVar

from gridpeers.wire.driver.machine import usable_cores

T = TypeVar("T")
R = TypeVar("R")

MOST_THREADS = 4
"""Threads, as far as there are cores: more of them share one path to the memory."""


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
