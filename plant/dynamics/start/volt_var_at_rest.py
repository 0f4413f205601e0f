"""Where each inverter rests on a volt-var characteristic with a dead band (section 4.4).

Unless the droop begins at the edge of its band, the characteristic jumps there, from 0 to db / m_q. An inverter whose
droop would bring its voltage back into the band, and whose voltage would leave the band without it, rests at neither:
its Q hunts around the one that holds the voltage on the edge. With that Q the characteristic has no gap and never rises
with the voltage; so where vars raise voltages, there is one operating point, and only one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.reduction.reduced import Real

DROOP, INSIDE, UNDER, OVER = range(4)
"""Where an inverter rests: on the droop, inside its band, or on the edge below or above V_set."""

AT_ONCE = 8
"""Rounds in which all inverters may change their place, then the first of them alone (Murty's least-index rule)."""


class VoltVarAtRest(NamedTuple):
    """Droops and bands of inverters, and the set-points and limits at rest; arrays over the inverters."""

    V_set: Real
    """pu."""
    m_q: Real
    """pu per pu."""
    db_UV: Real
    """Dead bands below V_set (pu); 0 for a GFM, infinite without volt-var."""
    db_OV: Real
    """The same above V_set."""
    from_edge: NDArray[np.bool_]
    """Whether the droop begins at the edge of the band: there is no jump, and the place is always `DROOP`."""
    Q_min: Real
    """Limits of reactive power (pu)."""
    Q_max: Real

    def first_places(self) -> NDArray[np.int64]:
        """Return where the search begins: inside of every band at whose edges the characteristic jumps."""
        return np.where(((self.db_UV > 0.0) | (self.db_OV > 0.0)) & ~self.from_edge, INSIDE, DROOP)

    def beyond(self, v: Real) -> Real:
        """Return the deviation on which the droop acts (pu): from V_set, or from the edge of the band."""
        low = self.V_set - v
        return np.where(self.from_edge, low - np.clip(low, -self.db_OV, self.db_UV), low)

    def within(self) -> Real:
        """Return the vars within the band (pu): none, unless the limits exclude that."""
        return np.clip(np.zeros(self.m_q.size), self.Q_min, self.Q_max)

    def mismatch(self, place: NDArray[np.int64], v: Real, Q: Real) -> Real:
        """Return how far (pu of voltage) Q at voltages v is from rest; 0 for all is rest at these places."""
        low = self.V_set - v
        wanted = np.clip(self.beyond(v) / self.m_q, self.Q_min, self.Q_max)
        off = (np.where(place == INSIDE, self.within(), wanted) - Q) * self.m_q
        off = np.where(place == UNDER, low - self.db_UV, off)
        return np.where(place == OVER, low + self.db_OV, off)

    def next_places(self, place: NDArray[np.int64], v: Real, Q: Real, rounds: int) -> NDArray[np.int64]:
        """Return where inverters belong that rest with Q at v; the same places once they are right.

        Parameters
        ----------
        place
            Where they were taken to be.
        v, Q
            Voltages and reactive powers with which they rest there (pu).
        rounds
            How often places have changed before.
        """
        low = self.V_set - v
        within = (-self.db_OV < low) & (low < self.db_UV) & ~self.from_edge
        band, limit = (
            np.where(place == UNDER, *pair) for pair in ((self.db_UV, self.db_OV), (self.Q_max, -self.Q_min))
        )
        on_jump = np.minimum(band / self.m_q, limit)
        inward = np.where(place == UNDER, Q, -Q)  # of an inverter on an edge: what holds its voltage there
        edge = np.where(Q > 0.0, UNDER, OVER)
        edge = np.where(np.isinf(np.where(Q > 0.0, self.db_UV, self.db_OV)), INSIDE, edge)
        right = np.where((place == INSIDE) & ~within, DROOP, place)
        right = np.where((place == DROOP) & within, edge, right)
        on_edge = (place == UNDER) | (place == OVER)
        right = np.where(on_edge & (inward <= 0.0), INSIDE, right)
        right = np.where(on_edge & (inward > on_jump), DROOP, right)
        if rounds < AT_ONCE:
            return right
        changed = place.copy()
        first = np.flatnonzero(right != place)[:1]
        changed[first] = right[first]
        return changed
