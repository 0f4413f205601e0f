"""One thread of linear algebra in this process for as long as any run is in it.

`plant.dynamics` holds BLAS to one thread while it factors, as two give other last digits. That limit is of the whole
process: where a Dask worker runs several threads, the first that is through would lift it under the others, and a
row would depend on its neighbours. So it is set by the first run and lifted after the last.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController

_lock = threading.Lock()
_held = ExitStack()
_inside = 0


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold BLAS to one thread together with all others that are inside."""
    global _inside
    with _lock:
        if _inside == 0:
            _held.enter_context(_controller().limit(limits=1, user_api="blas"))
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _held.close()


@cache
def _controller() -> ThreadpoolController:
    """Finding the loaded libraries takes as long as many a run; numpy and scipy are loaded by now."""
    return ThreadpoolController()
