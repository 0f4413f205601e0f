"""Events of limits, once a spell: of set-points beyond an inverter's bounds, and of its phase currents."""

from __future__ import annotations

from math import inf

import numpy as np

from gridpeers.plant.dynamics.kernel.compiled import Flags
from gridpeers.wire.messages import PlantEvent

SPELL = 1.0  # time (s) without a limited set-point after which a spell is over
PAUSE = 0.1  # the same for limited phase currents (s)

_UNIT = {"P_set": "kW", "V_set": "V"}


class Spells:
    """Times at which limits have acted; `pause`: time (s) without one that ends a spell."""

    def __init__(self, pause: float) -> None:
        self._pause = pause
        self._last: dict[tuple[str, str], float] = {}

    def begins(self, name: str, t: float, quantity: str = "") -> bool:
        """Note that a limit of an inverter acts at t (s); return whether a spell begins with it."""
        since = t - self._last.get((name, quantity), -inf)
        self._last[name, quantity] = t
        return since > self._pause


class SetPointLimits:
    def __init__(self) -> None:
        self._spells = Spells(SPELL)

    def held(self, name: str, t: float, quantity: str, set_point: float, held: float) -> list[PlantEvent]:
        """Compare an inverter's set-point at t (s) with the held one (kW or V), apart from rounding."""
        if abs(set_point - held) <= 1e-9 * abs(set_point) or not self._spells.begins(name, t, quantity):
            return []
        unit = _UNIT[quantity]
        text = f"{name} gets {quantity} {set_point:g} {unit}, which is beyond its bound; it holds {held:g} {unit}"
        return [PlantEvent(t=t, kind="limit", subject=name, text=text)]

    def refused(self, name: str, t: float) -> list[PlantEvent]:
        if not self._spells.begins(name, t):
            return []
        text = f"{name} gets set-points that are not finite numbers; it keeps the present ones"
        return [PlantEvent(t=t, kind="limit", subject=name, text=text)]


class CurrentLimits:
    """Report the inverters whose phases are at their limit, `I_max` (pu)."""

    def __init__(self, names: tuple[str, ...], I_max: tuple[float, ...]) -> None:
        self._names, self._I_max = names, I_max
        self._spells = Spells(PAUSE)

    def report(self, t: float, limiting: Flags) -> list[PlantEvent]:
        texts = {
            self._names[i]: f"{self._names[i]} limits its phase currents to {self._I_max[i]:g} pu"
            for i in np.flatnonzero(limiting).tolist()
            if self._spells.begins(self._names[i], t)
        }
        return [PlantEvent(t=t, kind="limit", subject=name, text=text) for name, text in texts.items()]
