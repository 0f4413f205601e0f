"""Events of limits, once per spell: of set-points, of phase currents, of voltages at which a load's law jumps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Real
from gridpeers.plant.dynamics.kernel.solve import COLUMNS, limited_admittance
from gridpeers.plant.network import Network
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import first_of

SPELL = 1.0  # time (s) without a limited set-point after which a spell is over

_UNIT = {"P_set": "kW", "V_set": "V"}


class SetPointLimits:
    """Report set-points beyond an inverter's bounds: one event a spell."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, str], float] = {}  # time (s) of the last limited one of each present spell
        self._refused: set[str] = set()

    def held(self, name: str, t: float, quantity: str, set_point: float, held: float) -> list[PlantEvent]:
        """Compare an inverter's set-point at t (s) with the held one (kW or V), apart from rounding."""
        key, unit = (name, quantity), _UNIT[quantity]
        begun = key in self._last
        if abs(set_point - held) <= 1e-9 * abs(set_point):
            if begun and t - self._last[key] >= SPELL:
                del self._last[key]
            return []
        self._last[key] = t
        if begun:
            return []
        text = f"{name} gets {quantity} {set_point:g} {unit}, which is beyond its bound; it holds {held:g} {unit}"
        return [PlantEvent(t=t, kind="limit", subject=name, text=text)]

    def refused(self, name: str, t: float) -> list[PlantEvent]:
        if name in self._refused:
            return []
        self._refused.add(name)
        text = f"{name} gets set-points that are not finite numbers; it keeps the present ones"
        return [PlantEvent(t=t, kind="limit", subject=name, text=text)]


LIMITS = "limits its phase currents"  # words that tell these events from others of the kind `limit`
PAUSE = 0.1  # time (s) without limiting after which the next limiting is a spell of its own


class CurrentLimits:
    """Report the inverters whose phases are at their limit, `I_max` (pu), once a spell."""

    def __init__(self, names: tuple[str, ...], I_max: tuple[float, ...]) -> None:
        self._names, self._I_max = names, I_max
        self._last = [-np.inf] * len(names)

    def report(self, t: float, limiting: Flags) -> list[PlantEvent]:
        events = []
        for i in np.flatnonzero(limiting).tolist():
            name, since = self._names[i], t - self._last[i]
            self._last[i] = t
            if since > PAUSE:
                text = f"{name} {LIMITS} to {self._I_max[i]:g} pu"
                events.append(PlantEvent(t=t, kind="limit", subject=name, text=text))
        return events


CROSSING_PAUSE = 0.5  # time (s) without a crossing after which a load's next crossing is reported
SHOWN = 3  # loads that an event names
BESIDE = 1e-9  # distance from a limit, in proportion, at which the law beside it is taken; a jump is larger by far

LAW_LIMITS = {"V_min": -1, "V_max": 1}  # limits of a load's law, and the side on which a load is beyond them


class _Jump(NamedTuple):
    name: str  # name of its load
    branch: int
    V: float
    limit: str  # its name, of `LAW_LIMITS`
    S: tuple[float, float]  # apparent power (VA) just within the limit and just beyond it


class LoadLimits:
    """Loads of an imported feeder whose law jumps at V_min or V_max, as that of OpenDSS's models 3, 4 and 6 does.

    `V`: voltages across its load branches at the start (V).
    """

    def __init__(self, network: Network, V: Complex) -> None:
        self._jumps = _jumps(network)
        self.any = bool(self._jumps)  # whether a load has such a limit
        self._branches = np.array([jump.branch for jump in self._jumps], np.int64)
        self._V = np.array([jump.V for jump in self._jumps])
        self._side = np.array([LAW_LIMITS[jump.limit] for jump in self._jumps])
        self._beyond = self._are_beyond(np.abs(V[self._branches]))
        self._last: dict[str, float] = {}

    def report(self, t: float, V: Complex) -> list[PlantEvent]:
        """Return an event for each limit and direction of crossings since the last call, at these voltages (V)."""
        magnitude = np.abs(V[self._branches])
        now = np.where(magnitude > 0.0, self._are_beyond(magnitude), self._beyond)
        groups: dict[tuple[str, bool], list[_Jump]] = {}
        for k in np.flatnonzero(now != self._beyond).tolist():
            groups.setdefault((self._jumps[k].limit, bool(now[k])), []).append(self._jumps[k])
        self._beyond = now
        events = []
        for (limit, beyond), jumps in groups.items():
            crossed = dict.fromkeys(jump.name for jump in jumps)
            names = [name for name in crossed if t - self._last.get(name, -np.inf) > CROSSING_PAUSE]
            self._last.update(dict.fromkeys(crossed, t))
            if not names:
                continue
            within, outside = (sum(jump.S[k] for jump in jumps if jump.name in names) for k in (0, 1))
            change = (outside - within if beyond else within - outside) / (within if beyond else outside)
            way = "rises above" if (LAW_LIMITS[limit] > 0) == beyond else "falls below"
            text = (
                f"voltage of {first_of(names, SHOWN)} {way} {limit}, where the law of such a load jumps: "
                f"{abs(change):.0%} {'more' if change > 0.0 else 'less'} apparent power at once"
            )
            events.append(PlantEvent(t=t, kind="limit", subject=names[0], text=text))
        return events

    def _are_beyond(self, magnitude: Real) -> Flags:
        return np.asarray(self._side * (magnitude - self._V) > 0.0)


def _jumps(network: Network) -> list[_Jump]:
    law = network.loads().law
    names = [part.name for part in network.feeder.load_parts if not part.is_impedance]
    found = []
    for name, branch, row in zip(names, law.limited_at.tolist(), law.law, strict=True):
        for limit, side in LAW_LIMITS.items():
            if V := float(row[COLUMNS.index(limit)]):
                within, beyond = (abs(limited_admittance(row, V * (1.0 + k * BESIDE))[0]) * V**2 for k in (-side, side))
                if abs(beyond - within) > 1e3 * BESIDE * within:
                    found.append(_Jump(name, branch, V, limit, (within, beyond)))
    return found
