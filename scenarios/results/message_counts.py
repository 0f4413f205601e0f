"""How many messages the laws of a run saved: states that an agent did not tell its neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from scenarios.results.metrics import Window


def messages_saved(
    quiet: Iterable[tuple[float, int]], windows: Sequence[Window], agents: int, T_c: float
) -> dict[str, float]:
    """Return the share of states that were not told, by window; nothing if every state of the run was.

    Parameters
    ----------
    quiet : Iterable[tuple[float, int]]
        Run time (s) and number of states that were not told at that tick.
    windows : Sequence[Window]
        Windows of measurement.
    agents : int
        Agents of the run, each of which decides once a period.
    T_c : float
        Control period (s).

    Examples
    --------
    >>> messages_saved([(1.0, 3), (1.02, 1)], [Window(label="event1", start=1.0, end=1.04)], agents=4, T_c=0.02)
    {'event1': 0.5}
    """
    quiet = list(quiet)
    if not quiet:
        return {}
    near = 0.5 * T_c
    saved = {}
    for window in windows:
        count = sum(n for t, n in quiet if window.start - near <= t < window.end - near)
        saved[window.label] = count / (agents * max(1, round((window.end - window.start) / T_c)))
    return saved
