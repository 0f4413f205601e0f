"""The style of all figures, and figures as files whose bytes are the same each time."""

from __future__ import annotations

from scenarios.results.plots.saving import Format, save
from scenarios.results.plots.style import PAGE, case_styles

__all__ = [
    "PAGE",
    "Format",
    "case_styles",
    "save",
]
