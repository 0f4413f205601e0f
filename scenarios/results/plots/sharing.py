"""Sharing indices as figures have them: nothing where there is next to nothing to share, as in the report."""

from __future__ import annotations

import numpy as np

from scenarios.results import metrics
from scenarios.results.history import Floats, History, Plates


def MPSI(history: History, plates: Plates) -> Floats:
    """Mean power sharing index of each row, (16); not a number without a load."""
    return _where_shared(metrics.MPSI(history, plates), history.P, history, plates)


def MQSI(history: History, plates: Plates) -> Floats:
    """Mean var sharing index of each row, (17); not a number without vars."""
    return _where_shared(metrics.MQSI(history, plates), history.Q, history, plates)


def _where_shared(index: Floats, x: Floats, history: History, plates: Plates) -> Floats:
    """Return an index where the total of x (W or var) is at least `NO_LOAD` of the ratings: below, it divides dust."""
    sharing = history.present & plates.shares
    total = np.abs(np.where(sharing, x, 0.0).sum(axis=1))
    rated = np.where(sharing, plates.s, 0.0).sum(axis=1)
    return np.where(total < metrics.NO_LOAD * rated, np.nan, index)
