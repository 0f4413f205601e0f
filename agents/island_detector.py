"""Who has fallen out of step with the own inverter: islands told apart by frequency alone. Pure.

Inverters of one island run in step. Their angles differ by what the lines between them ask for, a few degrees, so
however the frequency moves, the difference of two frequencies has next to no integral:

    slip_ij(t) = int (f_i - f_j) dt        in cycles

Between islands it grows without bound, unless both are at exactly the same frequency; and islands that wrongly listen
to each other seldom are: their set-points agree on what fits none of them, and each keeps an error of its own. A slip
beyond `slip_max` thus proves another island. Nothing proves the same one: two islands at 60 Hz look like one. So who
was out of step is tried again after a while, and left out for longer if that was too early.

Every agent integrates its own frequency and tells the sum, its `angle`: so states that are lost or late cost nothing.

The paper has no such thing; its agents know the switches. The idea is that of out-of-step and of loss-of-mains relays
(phase-angle drift), used between peers.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from wire.messages import Angle

T_LEAK = 10.0
"""Time constant (s) with which slip is forgotten: sensors that disagree by less than slip_max / T_LEAK (Hz) count as in
step."""

T_GAP = 0.2
"""Longest time (s) between two own measurements over which the frequency is taken to be known."""

RETRY, LONGEST = 10.0, 600.0
"""Time (s) after which whoever was out of step is tried again, the first time; and at most, doubled each time."""

TRUSTED = 10.0
"""Time (s) in step after a retry from which on the next time out of step counts as the first."""

KEPT = 512
"""Own measurements that are kept, to be compared with states that come late: 10 s at 20 ms."""


@dataclass
class _Pair:
    """How one neighbour stands to the own inverter."""

    since: tuple[float, float] | None = None
    """Whence the two angles count (s)."""
    t: float = 0.0
    """Time of the last state that was compared (s)."""
    slip: float = 0.0
    """Cycles."""
    usual: float = 0.0
    """Difference of the angles from which slip counts (cycles)."""
    back: float | None = None
    """When it is tried again (s); None while it counts as in step."""
    tried: float | None = None
    """When it was last tried again (s)."""
    hold: float = RETRY
    """For how long it was left out last (s)."""

    def compare(self, since: tuple[float, float], t: float, difference: float) -> None:
        """Note the difference of the angles (cycles) at t (s)."""
        if since != self.since:
            self.since, self.usual = since, difference
        else:
            self.usual += min(1.0, (t - self.t) / T_LEAK) * (difference - self.usual)
        self.t, self.slip = t, difference - self.usual


class IslandDetector:
    """Which neighbours are out of step with one inverter.

    Parameters
    ----------
    f_nom : float
        Nominal frequency (Hz).
    slip_max : float
        Slip (cycles) beyond which a neighbour stands in another island.

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
        """What the own inverter tells; None if it has measured nothing."""
        return Angle(self._own[-1][2], self._since) if self._own else None

    def sensed(self, t: float, f: float) -> None:
        """Note the own frequency (Hz) at t (s of run time); after a gap the own angle counts anew."""
        e, angle = f - self._f_nom, 0.0
        if self._own and 0.0 <= t - self._own[-1][0] <= T_GAP:
            before, e_before, angle_before = self._own[-1]
            angle = angle_before + 0.5 * (e_before + e) * (t - before)
        else:
            self._own.clear()
            self._since = t
        self._own.append((t, e, angle))

    def heard(self, name: str, t: float, angle: Angle | None) -> None:
        """Note a neighbour's angle at t (s), if it is news."""
        pair = self._pairs.setdefault(name, _Pair())
        if angle is None or (pair.since is not None and t <= pair.t):
            return
        own = self._own_at(t)
        if own is not None:
            pair.compare((self._since, angle.since), t, own - angle.cycles)

    def apart(self, name: str, t: float) -> bool:
        """Whether a neighbour is taken to stand in another island at t (s of run time)."""
        pair = self._pairs.get(name)
        if pair is None:
            return False
        if pair.back is not None and t >= pair.back:
            pair.back, pair.tried, pair.since, pair.slip = None, t, None, 0.0
        if pair.back is None and abs(pair.slip) > self._slip_max:
            again = pair.tried is not None and t - pair.tried < TRUSTED
            pair.hold = min(2.0 * pair.hold, LONGEST) if again else RETRY
            pair.back = t + pair.hold
        return pair.back is not None

    def forget(self, name: str) -> None:
        """Forget a neighbour that is gone."""
        self._pairs.pop(name, None)

    def restart(self) -> None:
        """Forget all neighbours: on the grid all are in step."""
        self._pairs.clear()

    def _own_at(self, t: float) -> float | None:
        """Own angle (cycles) at t (s), from the last measurement before; None if that is not known."""
        for at, e, angle in reversed(self._own):
            if at <= t:
                return angle + e * (t - at) if t - at <= T_GAP else None
        return None
