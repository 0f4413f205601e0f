"""Blocks of memory from the system itself, so that a process of hours does not grow by holes in its heap."""

from __future__ import annotations

import contextlib
import ctypes

_M_MMAP_THRESHOLD = -3
"""Option of mallopt(3)."""

LARGE = 128 * 1024
"""Bytes from which on a block comes from the system, and goes back to it at once."""


def keep_out_of_the_heap() -> None:
    """Have every block from `LARGE` on come from the system, for good; nothing where the C library is not glibc.

    That is glibc's rule at first, but it takes the size of each such block that is freed as its new bound, up to
    32 MB. Large messages then come and go in the heap, between small ones that stay: a recorder grew by a tenth in an
    hour with nothing more in use.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):  # no libc by this name, or another one
        ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, LARGE)


def give_back_freed() -> None:
    """Give the heap's freed memory back to the system; nothing where the C library is not glibc.

    It takes 1 ms in an agent, and more where more is free: 28 ms for 75 MB.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
