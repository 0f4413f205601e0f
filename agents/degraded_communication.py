"""An agent's options for bad links, saturation and islands: `[degraded_communication]`. Pure.

The law is `gridpeers.agents.laws.consensus`; this module sets its weights c_ij, gains and limits. r_ij, from 0 to 1, is
the weight of neighbour j's state for i (`StalenessWeights`), and d_i the number of neighbours that count:

- weights "paper": c_ij = r_ij. The gain of the consensus on y = m_p P_set is kappa = m_p/k_p.
- weights "degree-normalised": c_ij = r_ij/d_i. The gain is kappa_c, that of the leader's frequency error stays kappa:
  y_i' = -kappa g_i e_i - kappa_c/d_i sum_j r_ij (y_i - y_j). In (14) and (15) beta becomes beta beta_c.

A neighbour counts while its nameplate is known, it is in the own island, it has sent a state, and that state
is no older than `max_age`. So a lossy link keeps its place in d_i, and a dead one loses it.

docs/reference/link-faults.md has the sources, and the cost of each option.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, inf

import msgspec
from msgspec.structs import replace

from gridpeers.agents.agent_config import Control, DegradedCommunication, Gains
from gridpeers.agents.laws.consensus import Consensus
from gridpeers.wire.messages import Angle

REMEMBERED = 51  # Number of arrivals over which the usual age on a link is a median: one second at 20 ms

OFF = 0.05
"""Distance (pu of own rating) beyond which an inverter is off its droop characteristic, and up to which it may wind up.
"""

P_BOUND, V_BOUND = 100.0, 10.0
"""Limits (pu) of P_set, in both directions, and of V_set, from 0, that exclude only implausible values."""


class StalenessWeights:
    """Weigh the last state of each neighbour, from 0 to 1, by `stale`, `T_age` and `max_age`."""

    def __init__(self, options: DegradedCommunication) -> None:
        self._stale, self._T_age = options.stale, options.T_age
        self._max_age = options.max_age + 1e-9 if options.max_age else inf  # 2.0 - 1.9 counts as 0.1
        self.ages_count = self._stale != "hold"
        self.all_count = not self.ages_count and self._max_age == inf
        self._fresh: set[str] = set()
        self._usual: dict[str, deque[float]] = {}
        """Ages (s) of each neighbour's last states, each at the first tick that could use it."""

    def arrived(self, name: str) -> None:
        if self.ages_count:
            self._fresh.add(name)

    def forget(self, name: str) -> None:
        self._fresh.discard(name)
        self._usual.pop(name, None)

    def at_tick(self, ages: Mapping[str, float]) -> dict[str, float]:
        """Return the weight of each neighbour that counts at this tick, by the ages of their last states (s)."""
        most = self._max_age
        if not self.ages_count:
            return {name: 1.0 for name, age in ages.items() if age <= most}
        weights = {name: self._of(name, age) for name, age in ages.items() if age <= most}
        self._fresh.clear()
        return weights

    def _of(self, name: str, age: float) -> float:
        fresh = name in self._fresh
        if self._stale == "skip":
            return float(fresh)
        usual = self._usual.setdefault(name, deque(maxlen=REMEMBERED))
        if fresh or not usual:
            usual.append(age)
        median = sorted(usual)[len(usual) // 2]
        return exp(-max(0.0, age - median) / self._T_age)


class SaturationDetector:
    """Detect an inverter that has stayed off its droop characteristic: a larger set-point has no effect there.

    A slow inverter is off its characteristic too, but approaches it. So only T_sat (s) off on the same side counts,
    with less than half of the difference made up.
    """

    def __init__(self, T_sat: float) -> None:
        self._T_sat = T_sat
        self._side = 0
        self._since: deque[tuple[float, float]] = deque()
        """Times (s) and outputs (pu) since it went to this side; of those older than T_sat only the last."""

    def begin(self) -> None:
        self._side = 0
        self._since.clear()

    def saturated_side(self, should: float, does: float, t: float) -> int:
        """Return 1 where the inverter delivers too little and cannot deliver more, -1 for too much, else 0.

        `should` is the output that the set-point requires (pu), `does` the measured one plus the droop's part (pu).
        """
        short = should - does
        side = (short > OFF) - (short < -OFF)
        if side != self._side:
            self._side = side
            self._since.clear()
        self._since.append((t, does))
        limit = t - self._T_sat + 1e-9
        while len(self._since) > 1 and self._since[1][0] <= limit:
            self._since.popleft()
        at, did = self._since[0]
        return side if at <= limit and (does - did) * side < 0.5 * abs(short) else 0


def gains_in_force(gains: Gains, options: DegradedCommunication) -> Gains:
    if options.weights == "degree-normalised":
        beta_c = options.beta_c
        gains = replace(gains, beta_GFM=gains.beta_GFM * beta_c, beta_GFL=gains.beta_GFL * beta_c)
    if options.anti_windup == "none":
        gains = replace(gains, P_set_min=-P_BOUND, P_set_max=P_BOUND, V_set_min=0.0, V_set_max=V_BOUND)
    return gains


def law_in_force(control: Control) -> Consensus:
    options = control.degraded_communication
    gains = gains_in_force(control.gains, options)
    kappa_c = options.kappa_c if options.weights == "degree-normalised" else 0.0
    return Consensus(**msgspec.structs.asdict(gains), kappa_c=kappa_c)


T_LEAK = 10.0
"""Time constant (s) with which slip decays: sensors that disagree by less than slip_max / T_LEAK (Hz) count as in
step."""

T_GAP = 0.2  # Longest time (s) between two own measurements over which the frequency is integrated

RETRY, LONGEST_RETRY = 10.0, 600.0
"""First and longest time (s) until a retry of a neighbour out of step; it doubles each time."""

TRUSTED = 10.0  # Time (s) in step after a retry, after which the next loss of step counts as the first
KEPT = 512  # Number of own measurements to keep for the comparison with late states: 10 s at 20 ms


@dataclass
class _Pair:
    since: tuple[float, float] | None = None
    """Times (s) from which the two angles count."""
    t: float = 0.0
    slip: float = 0.0
    """Difference of the angles beyond the usual one (cycles)."""
    usual: float = 0.0
    """Usual difference of the angles, from which slip counts (cycles)."""
    back: float | None = None
    """Time of the next retry (s); None while it counts as in step."""
    tried: float | None = None
    hold: float = RETRY

    def compare(self, since: tuple[float, float], t: float, difference: float) -> None:
        if since != self.since:
            self.since, self.usual = since, difference
        else:
            self.usual += min(1.0, (t - self.t) / T_LEAK) * (difference - self.usual)
        self.t, self.slip = t, difference - self.usual


class IslandDetector:
    """Detect neighbours in another island by angle drift, from frequency alone.

    Inverters of one island run in step. The lines between them need angle differences of only a few degrees, so
    however the frequency moves, the difference of two frequencies has almost no integral:

        slip_ij(t) = int (f_i - f_j) dt        in cycles

    Between islands the slip grows without bound, unless both have exactly the same frequency. A slip beyond
    `slip_max` (cycles) thus proves another island. Nothing proves the same one, so an agent tries a neighbour out of
    step again after a while, and leaves it out for longer if that was too early. Every agent integrates its own
    frequency and sends the sum, its `angle`: so lost and late states cost nothing. The paper has no such detector.
    """

    def __init__(self, f_nom: float, slip_max: float) -> None:
        self._f_nom, self._slip_max = f_nom, slip_max
        self._own: deque[tuple[float, float, float]] = deque(maxlen=KEPT)
        """Own measurements, the latest last: time (s), departure of frequency (Hz), and its integral (cycles)."""
        self._since = 0.0
        self._pairs: dict[str, _Pair] = {}

    @property
    def angle(self) -> Angle | None:
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
        pair = self._pairs.setdefault(name, _Pair())
        if angle is None or (pair.since is not None and t <= pair.t):
            return
        before = next((own for own in reversed(self._own) if own[0] <= t), None)
        if before is not None and t - before[0] <= T_GAP:
            at, e, own = before
            pair.compare((self._since, angle.since), t, own + e * (t - at) - angle.cycles)

    def apart(self, name: str, t: float) -> bool:
        """Return whether the agent considers a neighbour to be in another island at t (s of run time)."""
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
        self._pairs.pop(name, None)

    def restart(self) -> None:
        self._pairs.clear()
