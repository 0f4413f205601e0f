"""Events of a run as lines for a person."""

from __future__ import annotations

import re

from wire.messages import PlantEvent


def line_of(event: PlantEvent) -> str:
    """An event in a line, its time first and only there, however many digits the plant gives it.

    Examples
    --------
    >>> line_of(PlantEvent(t=1.5, kind="roster", subject="inv2", text="inv2 joined, at t = 1.5 s"))
    '    1.50 s  inv2 joined'
    >>> line_of(PlantEvent(t=1.5, kind="roster", subject="inv2", text="inv2 joined, at t = 1.50 s"))
    '    1.50 s  inv2 joined'
    """
    return f"{event.t:8.2f} s  {re.sub(r', at t = [0-9.e+]+ s$', '', event.text)}"
