"""What the machine gives a process: cores, open files, memory."""

from __future__ import annotations

import ctypes
import errno
import os
from contextlib import suppress

POSIX = hasattr(os, "fork")  # False on Windows, where gridpeers runs in one process alone

if POSIX:
    import resource


def usable_cores() -> int:
    """Return their number: a container or a job of a cluster may have fewer than the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def schedule_as_batch() -> None:
    """Have this thread, and those that it starts from now on, not interrupt others as they wake.

    In simulated time nothing is due at an instant, but every message wakes several threads; where these take a core
    from a thread that computes, all wait for it. A policy that the user has chosen (`chrt`) stays.
    """
    if hasattr(os, "SCHED_BATCH") and os.sched_getscheduler(0) == os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


BESIDE_LINKS = 12  # Files that a process has open beside its links: standard streams, Zenoh's own, its listener
MOST_FILES = 65_536  # Limit that suffices for any run; a much greater one makes other programs slow to start


def limit() -> int:
    """Return the number of files that this process may have open; `MOST_FILES` where there is no limit."""
    if not POSIX:
        return MOST_FILES
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST_FILES if soft == resource.RLIM_INFINITY else soft


def raise_limit() -> None:
    """Raise the limit of this process, and of those that it starts, as far as the system lets everybody do it."""
    if not POSIX:
        return
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_FILES)
    if limit() < wanted:
        with suppress(OSError, ValueError):  # some systems allow less than they say; then the limit stays
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def links_objection(who: str, links: int) -> str:
    """Return why a process cannot have so many links, "" if it can: Zenoh would refuse some of them without a word."""
    needed = links + BESIDE_LINKS
    if limit() >= needed:
        return ""
    return (
        f"{who}: may have {limit()} files open at once, and needs {needed}: {links} links and {BESIDE_LINKS} more; "
        f"raise the limit, e.g. with ulimit -n {max(1024, 2 * needed)}"
    )


def too_few_files(error: BaseException) -> str:
    """Return what to do about an error, if it is that too many files are open; else an empty text."""
    if not isinstance(error, OSError) or error.errno not in (errno.EMFILE, errno.ENFILE):
        return ""
    return (
        f"too many files are open: this process may have {limit()}; raise the limit, e.g. with ulimit -n 1024, or let "
        "agents share processes (--processes)"
    )


def keep_out_of_the_heap() -> None:
    """Have every block from 128 KiB on come from the system, for good, and go back to it at once.

    Where the C library is not glibc, do nothing. glibc raises its bound to the size of each such block that is freed.
    Large messages then come and go between small ones that stay: a recorder grew by a tenth in an hour.
    """
    M_MMAP_THRESHOLD = -3  # of mallopt(3)
    with suppress(OSError, AttributeError, TypeError):  # no libc by this name, or another one
        ctypes.CDLL(None).mallopt(M_MMAP_THRESHOLD, 128 * 1024)
