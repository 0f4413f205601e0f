"""Count and report set-points beyond an inverter's bounds, by spells."""

from __future__ import annotations

from dataclasses import dataclass

from gridpeers.wire.messages import PlantEvent

SPELL = 1.0
"""Time (s) without a limited set-point after which a spell is over."""

_UNIT = {"P_set": "kW", "V_set": "V"}


@dataclass
class _Spell:
    """Consecutive limited set-points of one inverter."""

    count: int
    last: float
    """Time of the last one (s)."""
    farthest: float
    """The one farthest from the held value (kW or V)."""
    distance: float
    """Distance of that one (kW or V)."""


class SetPointLimits:
    """Report set-points beyond an inverter's bounds: one event when a spell begins, and one when it ends.

    Examples
    --------
    >>> limits = SetPointLimits()
    >>> [event.text for event in limits.held("inv1", 2.0, "P_set", set_point=10_000.0, held=1800.0)]
    ['inv1 gets P_set 10000 kW, which is beyond its bound; it holds 1800 kW']
    >>> limits.held("inv1", 2.02, "P_set", set_point=10_000.0, held=1800.0)
    []
    >>> [event.text for event in limits.held("inv1", 3.5, "P_set", set_point=500.0, held=500.0)]
    ['inv1 gets P_set within its bound again; 2 set-points were limited, the farthest 10000 kW']
    """

    def __init__(self) -> None:
        self._spells: dict[tuple[str, str], _Spell] = {}
        self._refused: set[str] = set()

    def held(self, name: str, t: float, quantity: str, set_point: float, held: float) -> list[PlantEvent]:
        """Compare an inverter's set-point at t (s) with the held one (kW or V), apart from rounding."""
        distance = abs(set_point - held)
        limited = distance > 1e-9 * abs(set_point)
        if not (limited or self._spells):
            return []
        key, unit = (name, quantity), _UNIT[quantity]
        spell = self._spells.get(key)
        if limited:
            if spell is None:
                self._spells[key] = _Spell(1, t, set_point, distance)
                beyond = f"{name} gets {quantity} {set_point:g} {unit}, which is beyond its bound"
                text = f"{beyond}; it holds {held:g} {unit}"
                return [PlantEvent(t=t, kind="limit", subject=name, text=text)]
            spell.count, spell.last = spell.count + 1, t
            if distance > spell.distance:
                spell.farthest, spell.distance = set_point, distance
        elif spell is not None and t - spell.last >= SPELL:
            del self._spells[key]
            text = (
                f"{name} gets {quantity} within its bound again; {spell.count} set-points were limited, "
                f"the farthest {spell.farthest:g} {unit}"
            )
            return [PlantEvent(t=t, kind="limit", subject=name, text=text)]
        return []

    def refused(self, name: str, t: float) -> list[PlantEvent]:
        """Note set-points that are not finite; report them once per inverter."""
        if name in self._refused:
            return []
        self._refused.add(name)
        text = f"{name} gets set-points that are not finite numbers; it keeps the present ones"
        return [PlantEvent(t=t, kind="limit", subject=name, text=text)]
