"""Detect neighbours in another island by angle drift, from frequency alone. Pure.

Inverters of one island run in step. The lines between them need angle differences of only a few degrees, so
however the frequency moves, the difference of two frequencies has almost no integral:

    slip_ij(t) = int (f_i - f_j) dt        in cycles

Between islands the slip grows without bound, unless both have exactly the same frequency. Islands that wrongly listen
to each other seldom do: their set-points agree on values that fit neither, and each keeps an error of its own. A slip
beyond `slip_max` thus proves another island. Nothing proves the same one: two islands at 60 Hz look like one. So an
agent tries a neighbour out of step again after a while, and leaves it out for longer if that was too early.

Every agent integrates its own frequency and sends the sum, its `angle`: so lost and late states cost nothing.

The paper has no such detector; its agents know the switches. Out-of-step and loss-of-mains relays use the same idea
(phase-angle drift); here peers use it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from gridpeers.wire.messages import Angle

T_LEAK = 10.0
"""Time constant (s) with which slip decays: sensors that disagree by less than slip_max / T_LEAK (Hz) count as in
step."""

T_GAP = 0.2
"""Longest time (s) between two own measurements over which the frequency counts as known."""

RETRY, LONGEST_RETRY = 10.0, 600.0
"""Time (s) until the first retry of a neighbour out of step, and the longest; it doubles each time."""

TRUSTED = 10.0
"""Time (s) in step after a retry, after which the next loss of step counts as the first."""

KEPT = 512
"""Number of own measurements to keep for the comparison with late states: 10 s at 20 ms."""


@dataclass
class _Pair:
    """Angle difference between one neighbour and the own inverter."""

    since: tuple[float, float] | None = None
    """Times (s) from which the two angles count."""
    t: float = 0.0
    """Time of the last compared state (s)."""
    slip: float = 0.0
    """Difference of the angles beyond the usual one (cycles)."""
    usual: float = 0.0
    """Usual difference of the angles, from which slip counts (cycles)."""
    back: float | None = None
    """Time of the next retry (s); None while it counts as in step."""
    tried: float | None = None
    """Time of the last retry (s)."""
    hold: float = RETRY
    """How long it was left out last (s)."""

    def compare(self, since: tuple[float, float], t: float, difference: float) -> None:
        """Note the difference of the angles (cycles) at t (s)."""
        if since != self.since:
            self.since, self.usual = since, difference
        else:
            self.usual += min(1.0, (t - self.t) / T_LEAK) * (difference - self.usual)
        self.t, self.slip = t, difference - self.usual


class IslandDetector:
    """Detect neighbours that are out of step with one inverter.

    Parameters
    ----------
    f_nom : float
        Nominal frequency (Hz).
    slip_max : float
        Slip (cycles) beyond which a neighbour counts as in another island.

    Examples
    --------
    A neighbour at 59.9 Hz slips by a cycle in 10 s, so by 0.05 in half a second:

    >>> here, there, apart = IslandDetector(60.0, 0.05), IslandDetector(60.0, 0.05), []
    >>> for k in range(50):
    ...     here.sensed(t=0.02 * k, f=60.0)
    ...     there.sensed(t=0.02 * k, f=59.9)
    ...     here.heard("inv4", 0.02 * k, there.angle)
    ...     apart.append(here.apart("inv4", t=0.02 * k))
    >>> round(0.02 * apart.index(True), 2)
    0.52
    """

    def __init__(self, f_nom: float, slip_max: float) -> None:
        self._f_nom, self._slip_max = f_nom, slip_max
        self._own: deque[tuple[float, float, float]] = deque(maxlen=KEPT)
        """Own measurements, the latest last: time (s), departure of frequency (Hz), and its integral (cycles)."""
        self._since = 0.0
        self._pairs: dict[str, _Pair] = {}

    @property
    def angle(self) -> Angle | None:
        """Own angle, for the neighbours; None before the first measurement."""
        return Angle(self._own[-1][2], self._since) if self._own else None

    def sensed(self, t: float, f: float) -> None:
        """Note the own frequency (Hz) at t (s of run time); after a gap the own angle restarts from 0."""
        e, angle = f - self._f_nom, 0.0
        if self._own and 0.0 <= t - self._own[-1][0] <= T_GAP:
            before, e_before, angle_before = self._own[-1]
            angle = angle_before + 0.5 * (e_before + e) * (t - before)
        else:
            self._own.clear()
            self._since = t
        self._own.append((t, e, angle))

    def heard(self, name: str, t: float, angle: Angle | None) -> None:
        """Note a neighbour's angle at t (s), if it is new."""
        pair = self._pairs.setdefault(name, _Pair())
        if angle is None or (pair.since is not None and t <= pair.t):
            return
        own = self._own_at(t)
        if own is not None:
            pair.compare((self._since, angle.since), t, own - angle.cycles)

    def apart(self, name: str, t: float) -> bool:
        """Whether a neighbour counts as in another island at t (s of run time)."""
        pair = self._pairs.get(name)
        if pair is None:
            return False
        if pair.back is not None and t >= pair.back:
            pair.back, pair.tried, pair.since, pair.slip = None, t, None, 0.0
        if pair.back is None and abs(pair.slip) > self._slip_max:
            again = pair.tried is not None and t - pair.tried < TRUSTED
            pair.hold = min(2.0 * pair.hold, LONGEST_RETRY) if again else RETRY
            pair.back = t + pair.hold
        return pair.back is not None

    def forget(self, name: str) -> None:
        """Forget a neighbour that is gone."""
        self._pairs.pop(name, None)

    def restart(self) -> None:
        """Forget all neighbours: while grid-connected all are in step."""
        self._pairs.clear()

    def _own_at(self, t: float) -> float | None:
        """Return the own angle (cycles) at t (s), from the last measurement before; None if it is unknown."""
        for at, e, angle in reversed(self._own):
            if at <= t:
                return angle + e * (t - at) if t - at <= T_GAP else None
        return None
