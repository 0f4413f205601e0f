"""Events of limits, once per spell: of set-points, and of phase currents."""

from __future__ import annotations

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import Flags
from gridpeers.wire.messages import PlantEvent

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
