"""Late steps of the plant, and what explains them. Pure.

A step is late if the plant makes it more than a control period after its due time. The plant counts them, and its
telemetry, five times a second, tells the count. What happened between two counts explains them, or nothing does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from bench.soak.process_sizes import MachineTime

OTHERS = 0.1
"""Least part of the machine's time that other programs take to explain a late step."""

STOLEN = 0.01
"""Least time (s) that the host takes from the machine to explain one."""

WAITED = 0.005
"""Least time (s) that the plant waits for a processor if a start, or another program, is to explain one."""


class Start(NamedTuple):
    """A process that was started, while it got ready: imports, first session."""

    text: str
    """What it is, e.g. "agent inv2"."""
    begin: float
    """When it was started (s, monotonic)."""
    end: float
    """When it was ready, or had ended (s, monotonic)."""


class LateSteps(NamedTuple):
    """Late steps between two counts."""

    t: float
    """Run time (s)."""
    steps: int
    """How many."""
    waited: float
    """How long the plant waited for a processor meanwhile (s)."""
    causes: tuple[str, ...]
    """What explains them; empty if nothing does."""


def late_steps(t: float, steps: int, before: MachineTime, after: MachineTime, starts: Sequence[Start]) -> LateSteps:
    """Return what explains some late steps.

    Parameters
    ----------
    t : float
        Run time (s).
    steps : int
        How many steps were late.
    before, after : MachineTime
        The machine before them and after them.
    starts : Sequence[Start]
        Processes that were started in the run.

    Examples
    --------
    >>> before = MachineTime(at=10.0, whole=0.0, busy=0.0, stolen=0.0, own=0.0, waited=0.0)
    >>> busy = before._replace(at=10.4, whole=0.8, busy=0.7, own=0.2, waited=0.03)
    >>> late_steps(5.0, 1, before, busy, [Start("agent inv2", 9.9, 10.6)]).causes
    ('start of agent inv2', 'other programs: 62 % of the machine')
    >>> late_steps(5.0, 1, before, before._replace(at=10.4, whole=0.8, busy=0.2, own=0.2), []).causes
    ()
    """
    waited = after.waited - before.waited
    causes = []
    whole = after.whole - before.whole
    if waited >= WAITED:
        causes += [f"start of {start.text}" for start in starts if start.begin <= after.at and start.end >= before.at]
        others = (after.busy - before.busy) - (after.own - before.own)
        if whole > 0.0 and others >= OTHERS * whole:
            causes.append(f"other programs: {100.0 * others / whole:.0f} % of the machine")
    if (stolen := after.stolen - before.stolen) >= STOLEN:
        causes.append(f"the host took {1e3 * stolen:.0f} ms")
    return LateSteps(t, steps, waited, tuple(causes))
