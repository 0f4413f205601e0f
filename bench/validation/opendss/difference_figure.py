"""The figure of differences from both OpenDSS engines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from bench.validation.opendss.opendss_engines import ENGINES
from bench.validation.validation_part import CaseResult


def difference_figure(results: Sequence[CaseResult], limit: float, *, of: str, what: str) -> Figure:
    """Draw the distribution of differences, a panel for each engine.

    Parameters
    ----------
    results
        Cases, with the differences (pu) by engine as their curves.
    limit
        Largest difference (pu) that passes.
    of
        What each difference is of, in the plural: "nodes".
    what
        What is different: "difference of V at a node".
    """
    figure = Figure(figsize=(8.0, 2.8), layout="constrained")
    panels = figure.subplots(1, len(ENGINES), sharey=True)
    for axes, engine in zip(panels, ENGINES, strict=True):
        for result in results:
            gap = np.sort(result.curves[engine])
            axes.semilogx(np.maximum(gap, 1e-16), np.linspace(0.0, 1.0, gap.size), label=result.case)
        axes.axvline(limit, color="black", linestyle=":", linewidth=1.0)
        axes.set_title(engine)
        axes.set_xlabel(f"{what} (pu)")
    panels[0].set_ylabel(f"share of {of} below")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper")
    return figure
