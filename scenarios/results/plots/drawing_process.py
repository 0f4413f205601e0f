"""A process that draws some figures of a run: `python -m scenarios.results.plots.drawing_process` < PICKLE.

On standard input comes, pickled, what to draw, where to, and which share of the figures: the number of the share, from
0, and that of all shares. `scenarios.results.figure_processes` writes it.
"""

from __future__ import annotations

import pickle
import sys

from scenarios.results.plots.run_figures import draw_share

if __name__ == "__main__":
    draw_share(*pickle.loads(sys.stdin.buffer.read()))
