"""The entry of the command `gridpeers`: start ahead what a run needs, then read the command line.

Exit codes: 0 all is well, 1 a claim of the paper failed, 2 bad usage, a bad file, or output that cannot be written,
3 the run broke, 130 interrupted by Ctrl-C, 141 nobody reads the output any more, 143 by SIGTERM.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from wire.driver.leftover import leave
from wire.driver.output import speaking


def main() -> None:
    """Run the command line; no bad input ends in a traceback."""
    try:
        _main()
    except SystemExit as end:
        leave(end.code if isinstance(end.code, int) else int(end.code is not None), _tell)
        raise


def _tell(line: str) -> None:
    print(f"gridpeers: {line}", file=sys.stderr)


def _main() -> None:
    # The plant's matrices are small: a second BLAS thread only spins, and takes a quarter of the time from the run.
    # It must be said before numpy is imported; the processes that are started inherit it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if runs_processes(sys.argv[1:]):  # what they import takes longer than all that comes before them here
        from scenarios.drivers.warm_servers import prepare

        prepare()
    with speaking("gridpeers"):
        from gridpeers.cli.root import app
        from gridpeers.cli.usage import BAD_INPUT, BROKEN, INSTALL, INTERRUPTED, fail

        try:
            app()
        except KeyboardInterrupt:
            fail(["interrupted; everything that was started has ended"], INTERRUPTED)
        except ModuleNotFoundError as error:
            fail([f"{error.name} is not installed; {INSTALL}"], BAD_INPUT)
        except OSError as error:  # the machine refuses something: no memory for a process, no room on a disk
            fail([str(error)], BROKEN)


def runs_processes(words: Sequence[str]) -> bool:
    """Return whether a command line looks like a run with processes; if it is none, what was started ends with it.

    Examples
    --------
    >>> runs_processes(["run", "islanding"]), runs_processes(["run", "islanding", "--driver=inprocess"])
    (True, False)
    >>> runs_processes(["run", "--help"]), runs_processes(["check", "islanding"])
    (False, False)
    """
    return words[:1] == ["run"] and len(words) > 1 and not any(word.endswith(_NO_PROCESSES) for word in words)


_NO_PROCESSES = "inprocess", "-h", "--help"
"""Ends of words by which `gridpeers run` starts no processes."""
