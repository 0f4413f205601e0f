"""Python's lists of freed objects, emptied now and then, so that a process of hours does not grow by them."""

from __future__ import annotations

import gc

PERIOD = 60.0
"""Time between two collections (s)."""


class FreeLists:
    """Empty the lists now and then.

    Python keeps up to 2000 freed tuples of each length up to 20 for new ones, 5 MB in all. Messages of many lengths
    fill these lists within half an hour. Only a full collection empties them, and one hardly ever comes in a process
    that makes no garbage.

    Parameters
    ----------
    now : float
        Time of the process (s).
    """

    def __init__(self, now: float) -> None:
        self._due = now + PERIOD
        self._settled = False

    def tend(self, now: float) -> bool:
        """Collect if it is time (s); return whether it was.

        The first time takes some ms, and what there is then stays: later collections pass it over and take some 0.1 ms.
        """
        if now < self._due:
            return False
        gc.collect()
        if not self._settled:
            gc.freeze()
            self._settled = True
        self._due = now + PERIOD
        return True
