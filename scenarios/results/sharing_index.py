"""The sharing index of the paper, (16) and (17): how unequally inverters share a total power. Pure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

NO_LOAD = 0.001  # Part of the ratings below which a total power is too small for its sharing to mean anything


def eta(x: Floats, s: Floats, m: Floats, present: Flags | None = None) -> Floats:
    r"""Return the equal-sharing value of each row, (9): of powers x (W or var), ratings s (W) and droops m (pu per pu).

    .. math:: \eta = \frac{\sum_i x_i}{\sum_i s_i / m_i}
    """
    everybody = np.ones(x.shape, bool) if present is None else present
    total: Floats = np.where(everybody, x, 0.0).sum(axis=1)
    capacity: Floats = np.where(everybody, s / m, 0.0).sum(axis=1)
    return total / np.where(capacity > 0.0, capacity, np.nan)


def sharing_index(x: Floats, s: Floats, m: Floats, present: Flags | None = None) -> Floats:
    r"""Return the mean sharing index of each row: (16) with P and m_p, (17) with Q and m_q.

    .. math:: \frac{1}{N} \sum_i \left| \frac{m_i x_i / s_i - \eta}{\eta} \right|

    N counts the inverters that are present in the row, as the sums do. Where the total of x is below `NO_LOAD` of the
    ratings, there is next to nothing to share, and the index is not a number.
    """
    everybody = np.ones(x.shape, bool) if present is None else present
    equal = eta(x, s, m, everybody)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        index = mean_over(np.abs((m * x / s - equal) / equal), everybody)
    total, rated = (np.where(everybody, of, 0.0).sum(axis=1) for of in (x, s))
    index[np.abs(total) < NO_LOAD * rated] = np.nan
    return index


def mean_over(x: Floats, present: Flags) -> Floats:
    """Return the mean of each row over the inverters that are present in it; nan where there are none."""
    count = present.sum(axis=1)
    total: Floats = np.where(present, x, 0.0).sum(axis=1)
    return total / np.where(count > 0, count, np.nan)
