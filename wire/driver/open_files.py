"""The files that this process may have open at once: each link is one of them."""

from __future__ import annotations

import errno
from contextlib import suppress

try:
    import resource
except ImportError:  # a system without limits
    resource = None  # type: ignore[assignment]

BESIDE_LINKS = 12
"""Files that a process has open beside its links: standard streams, Zenoh's own, its listener."""

MOST_FILES = 65_536
"""Limit that suffices for any run; a much greater one makes other programs slow to start."""


class OpenFilesError(RuntimeError):
    """Too few files may be open; the message says how many, how many are needed, and what to do."""


def limit() -> int:
    """Return the number of files that this process may have open; `MOST_FILES` where there is no limit."""
    if resource is None:
        return MOST_FILES
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST_FILES if soft == resource.RLIM_INFINITY else soft


def raise_limit() -> None:
    """Raise the limit of this process, and of those that it starts, as far as the system lets everybody do it."""
    if resource is None:
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MOST_FILES if hard == resource.RLIM_INFINITY else min(hard, MOST_FILES)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        with suppress(OSError, ValueError):  # some systems allow less than they say; then the limit stays
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


def check_open_files(who: str, links: int) -> None:
    """Raise OpenFilesError if a process cannot have so many links: Zenoh would refuse some of them without a word."""
    needed = links + BESIDE_LINKS
    if limit() < needed:
        raise OpenFilesError(
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
