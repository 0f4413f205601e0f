"""A process that draws some figures of a run: `python -m scenarios.results.plots.drawing_process` < PICKLE.

On standard input comes, pickled, what to draw, where to, and which share of the figures: number k of n processes draws
every n-th, from the k-th on. `scenarios.results.figure_processes` writes it.
"""

from __future__ import annotations

import pickle
import sys

from scenarios.results.plots.run_figures import draw_share

if __name__ == "__main__":
    draw_share(*pickle.loads(sys.stdin.buffer.read()))
