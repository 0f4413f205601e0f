"""A process that draws some figures of a run: `python -m gridpeers.scenarios.results.plots.drawing_process` < PICKLE.

On standard input comes, pickled, what to draw, where to, and which share of the figures: the number of the share, from
0, and that of all shares. `gridpeers.scenarios.results.figure_processes` writes it, and closes its end when they are
drawn. If it ends before, the command was killed, and its folder may be that of another run by now.
"""

from __future__ import annotations

import os
import pickle
import sys
import threading

from gridpeers.scenarios.results.plots.run_figures import draw_all


def _end_with_the_command() -> None:
    os.read(sys.stdin.fileno(), 1)  # not through the buffer, whose lock Python wants at its own end
    os._exit(1)


if __name__ == "__main__":
    share = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_the_command, daemon=True).start()
    draw_all(*share)
