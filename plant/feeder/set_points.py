"""Set-points beyond what an inverter can do: counted and reported by spells."""

from __future__ import annotations

from dataclasses import dataclass

from wire.messages import PlantEvent

SPELL = 1.0
"""Time (s) without a limited set-point after which a spell is over."""

_UNIT = {"P_set": "kW", "V_set": "V"}


@dataclass
class _Spell:
    """Set-points of one inverter that were limited one after another."""

    count: int
    last: float
    """Time of the last one (s)."""
    farthest: float
    """The one farthest from what was held (kW or V)."""
    distance: float
    """How far that was (kW or V)."""


class SetPointLimits:
    """Which inverters are told set-points beyond their bounds: an event when it begins, and one when it ends.

    Examples
    --------
    >>> limits = SetPointLimits()
    >>> [event.text for event in limits.held("inv1", 2.0, "P_set", told=10_000.0, held=1800.0)]
    ['inv1 is told P_set 10000 kW, which is beyond its bound; it holds 1800 kW']
    >>> limits.held("inv1", 2.02, "P_set", told=10_000.0, held=1800.0)
    []
    >>> [event.text for event in limits.held("inv1", 3.5, "P_set", told=500.0, held=500.0)]
    ['inv1 is told P_set within its bound again; 2 set-points were limited, the farthest 10000 kW']
    """

    def __init__(self) -> None:
        self._spells: dict[tuple[str, str], _Spell] = {}
        self._refused: set[str] = set()

    def held(self, name: str, t: float, quantity: str, told: float, held: float) -> list[PlantEvent]:
        """Compare what an inverter is told at t (s) with what it holds (kW or V); rounding does not count."""
        key, unit, distance = (name, quantity), _UNIT[quantity], abs(told - held)
        spell = self._spells.get(key)
        if distance > 1e-9 * abs(told):
            if spell is None:
                self._spells[key] = _Spell(1, t, told, distance)
                text = f"{name} is told {quantity} {told:g} {unit}, which is beyond its bound; it holds {held:g} {unit}"
                return [PlantEvent(t=t, kind="limit", subject=name, text=text)]
            spell.count, spell.last = spell.count + 1, t
            if distance > spell.distance:
                spell.farthest, spell.distance = told, distance
        elif spell is not None and t - spell.last >= SPELL:
            del self._spells[key]
            text = (
                f"{name} is told {quantity} within its bound again; {spell.count} set-points were limited, "
                f"the farthest {spell.farthest:g} {unit}"
            )
            return [PlantEvent(t=t, kind="limit", subject=name, text=text)]
        return []

    def refused(self, name: str, t: float) -> list[PlantEvent]:
        """Note set-points that are no finite numbers; the event comes once per inverter."""
        if name in self._refused:
            return []
        self._refused.add(name)
        text = f"{name} is told set-points that are no finite numbers; it keeps those it has"
        return [PlantEvent(t=t, kind="limit", subject=name, text=text)]
