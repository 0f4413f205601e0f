"""The entry of the command `gridpeers`: start ahead what a run needs, then read the command line.

Exit codes: 0 all is well, 1 a claim of the paper failed, 2 bad usage, a bad file, or output that cannot be written,
3 the run broke, 130 interrupted by Ctrl-C, 141 nobody reads the output any more, 143 by SIGTERM.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import NoReturn

from gridpeers.wire.driver.ending import leave, speaking
from gridpeers.wire.driver.machine import raise_limit


def main() -> None:
    """Run the command line; no bad input ends in a traceback."""
    # The plant's matrices are small: a second BLAS thread only spins, and takes a quarter of the time from the run.
    # It must be said before numpy is imported; the processes that are started inherit it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    raise_limit()
    try:
        _start_ahead(sys.argv[1:])
        with speaking("gridpeers"):
            from gridpeers.cli.root import app

            app()
    except KeyboardInterrupt:  # before the command line is read
        _end("interrupted before anything had begun", 130)
    except ImportError as error:
        from gridpeers.wire.wording import not_importable

        _end(not_importable(error), 2)
    except SystemExit as end:
        if isinstance(end.code, int | None):
            leave(end.code or 0)
        raise


def _end(line: str, code: int) -> NoReturn:
    print(f"gridpeers: {line}", file=sys.stderr)
    sys.exit(code)


def _start_ahead(words: list[str]) -> None:
    """Start the servers of a run, whose imports take longer than all that comes before them here.

    Where that fails, the run starts them when it needs them, and says what is wrong.
    """
    if words[:1] != ["run"] or len(words) == 1 or not {"-h", "--help"}.isdisjoint(words):
        return
    if any(word.endswith("inprocess") for word in words):
        return
    with suppress(OSError):
        from gridpeers.scenarios.drivers.forking import prepare

        prepare()
