"""Draw the figures of a run on all cores, by processes that have imported matplotlib while the run went on.

Matplotlib takes 0.25 s to import and 1 s to draw the figures of a case, longer than the case takes. Such a process runs
this module.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from gridpeers.scenarios.drivers.forking import ForkedProcess, ForkServerError, figure_server
from gridpeers.wire.driver.machine import usable_cores

if TYPE_CHECKING:
    from gridpeers.scenarios.results.plots.drawing import Drawing

MODULE = "gridpeers.scenarios.results.figure_processes"

MOST = 4  # Processes, as far as there are cores: a run has eight figures or a few more


def prepare_figures() -> None:
    """Start the server of the processes that will draw, unless there is one core: then this process draws."""
    if _cores() > 1:
        figure_server()


@contextmanager
def drawn_on_all_cores(drawing: Drawing, folder: Path) -> Iterator[None]:
    """Draw every figure of a run into a folder, beside what is done in this context; leaving it waits for them.

    What a process cannot draw, this one draws again, and raises what went wrong.
    """
    started: list[ForkedProcess] = []
    try:
        all_at_work = _start(started, drawing, folder, _cores())
        yield
        if all_at_work and all([process.wait() == 0 for process in started]):
            return
    finally:
        for process in started:
            process.send_signal(signal.SIGKILL)
            process.wait()
            with suppress(BrokenPipeError):  # it has not read everything
                process.stdin.close()
        for unfinished in folder.glob(".*.png"):
            unfinished.unlink(missing_ok=True)
    from gridpeers.scenarios.results.plots.run_figures import draw_all  # imports matplotlib

    draw_all(drawing, folder)


def _start(started: list[ForkedProcess], drawing: Drawing, folder: Path, number: int) -> bool:
    """Start so many processes that draw, each a share; return whether all of them are at work."""
    server = figure_server(start=False)
    if number < 2 or server is None:
        return False
    try:
        with Path(os.devnull).open("wb") as log:  # the process that draws again says what went wrong
            started += [server.fork([MODULE], log, speaks=False) for _ in range(number)]
        for first, process in enumerate(started):
            process.stdin.write(pickle.dumps((drawing, folder, first, number)))
            process.stdin.flush()  # it stays open: a process that draws ends with this one
    except (ForkServerError, OSError, pickle.PicklingError):
        return False
    return True


def _cores() -> int:
    return min(usable_cores(), MOST)


def _draw_share() -> None:
    """Draw the share that comes, pickled, on standard input: drawing, folder, number of the share, number of shares."""
    from gridpeers.scenarios.results.plots.run_figures import draw_all

    share = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_the_command, daemon=True).start()
    draw_all(*share)


def _end_with_the_command() -> None:
    """End when the pipe does: a killed command's folder may be another run's by now."""
    os.read(sys.stdin.fileno(), 1)  # not through the buffer, whose lock Python wants at its own end
    os._exit(1)


if __name__ == "__main__":
    _draw_share()
