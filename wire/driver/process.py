"""Start, log and end of every process of a run.

Exit statuses: 0, the run ended, or the process was asked to leave; 1, an error of our own, with a traceback in the log;
2, a configuration that cannot work; 3, the run broke, or this process could not continue. With `--leash` a process that
ends in order has 96 more: so its parent tells this from an `exit()` in code that it runs, such as a library of a law.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from types import UnionType
from typing import Any, NoReturn, TypeVar

import msgspec

from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.driver.ending import leave, stop_at_signals, watch_readers
from gridpeers.wire.driver.machine import raise_limit
from gridpeers.wire.driver.session import SessionError
from gridpeers.wire.links import Links
from gridpeers.wire.wording import InputError

OK, BAD_CONFIG, BROKE = 0, 2, 3

IN_ORDER = 96  # Added to the exit status of a process on a leash that ends in order
_GRACE = 5.0  # Time (s) to end in order after the parent is gone

LEASH = "--leash"
"""Option: the configuration is one line, and the process ends when standard input does, as its parent is gone. A name
after it is for `ps` alone."""


def new_epoch() -> int:
    """Return an epoch for this process, which no other process of its name has.

    It is the time, in ms since 1970, and ten random bits, should a clock stand still or go back.
    """
    now = time.time_ns() // 1_000_000  # noqa: TID251  # tells two processes of one name apart, with random bits
    return (now % 2**43) << 10 | int.from_bytes(os.urandom(2), "little") >> 6


C = TypeVar("C")


class ConfigurationError(InputError):
    """A configuration that cannot work; the message says what would be right."""


MakeLinks = Callable[[str, Mapping[str, Any]], Links | None]
"""Function that makes the emulated links to a node, from its name and the tree `links` of its configuration."""


def no_links(name: str, tree: Mapping[str, Any]) -> None:
    if tree:
        raise ConfigurationError(
            f"{name}: the configuration has emulated links; start it with gridpeers.scenarios.emulation"
        )


def main(module: str, config_type: type[C] | UnionType, run: Callable[[C], str]) -> NoReturn:
    """Read the configuration, run, and end the process; `run` returns why the run broke, or an empty text."""
    leave(_main(module, config_type, run) + (IN_ORDER if LEASH in sys.argv[1:2] else 0))


def _main(module: str, config_type: type[C] | UnionType, run: Callable[[C], str]) -> int:
    watch_readers(quits=False)
    raise_limit()
    options = sys.argv[1:]
    if options[:1] not in ([], [LEASH]) or len(options) > 2:
        sys.stderr.write(f"usage: python -m {module} [{LEASH} [NAME]] < CONFIG.json\n")
        return BAD_CONFIG
    logging.basicConfig(level=logging.INFO, stream=sys.stderr, format="%(asctime)s %(levelname)s %(message)s")
    log = logging.getLogger(module)
    stop_at_signals(StoppedError)
    try:
        text = _read_line() if options else sys.stdin.buffer.read()
        config = decode_foreign(msgspec.json.Decoder(config_type).decode, text)
        if options:
            threading.Thread(target=_end_with_parent, daemon=True).start()
        broke = run(config)
    except (StoppedError, KeyboardInterrupt) as stop:
        log.info("asked to leave: %s", stop)
        return OK
    except (ConfigurationError, SessionError, msgspec.DecodeError) as error:
        log.error("configuration: %s", error)
        return BAD_CONFIG
    if broke:
        log.error("%s", broke)
        return BROKE
    return OK


def _read_line() -> bytes:
    """Return the first line of standard input, unbuffered: the thread that waits for its end reads the rest."""
    line = b""
    while not line.endswith(b"\n") and (piece := os.read(0, 65536)):
        line += piece
    return line


def _end_with_parent() -> None:
    while os.read(0, 4096):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
    threading.Event().wait(_GRACE)
    os._exit(BROKE)
