"""Single keys typed at a terminal, without Enter and without waiting."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_Read = Callable[[float], str]


@contextmanager
def keyboard() -> Iterator[_Read]:
    """Give a function that waits (s) for a key; "" if none came. Ctrl-C stays Ctrl-C.

    Where standard input is no terminal, or the system has no termios, no key ever comes and nobody waits for one.
    """
    try:
        import termios
        import tty
    except ImportError:
        yield lambda seconds: ""
        return
    try:
        file = sys.stdin.fileno()
        before = termios.tcgetattr(file)
    except (OSError, ValueError, termios.error):
        yield lambda seconds: ""
        return

    def read(seconds: float) -> str:
        ready, _, _ = select.select([file], [], [], seconds)
        return os.read(file, 1).decode(errors="replace") if ready else ""

    tty.setcbreak(file)
    try:
        yield read
    finally:
        termios.tcsetattr(file, termios.TCSADRAIN, before)
