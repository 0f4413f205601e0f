"""The style of all figures, and figures as files whose bytes are the same each time."""

from __future__ import annotations

from gridpeers.scenarios.results.plots.style import PAGE, Format, case_styles, save

__all__ = [
    "PAGE",
    "Format",
    "case_styles",
    "save",
]
