"""Report when the phase currents of grid-forming inverters are limited: once per spell, not at every step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.wire.messages import PlantEvent

LIMITS = "limits its phase currents"
"""Words of these events alone; their kind, `limit`, is that of set-points, available power and loads, too."""

PAUSE = 0.1
"""Time (s) without limiting after which the next limiting is a spell of its own."""


class CurrentLimits:
    """The inverters whose phases are, or were lately, at their limit.

    Parameters
    ----------
    names
        The inverters.
    I_max
        Their limits (pu), 0 for an inverter without one.

    Examples
    --------
    >>> limits = CurrentLimits(("inv1",), (2.0,))
    >>> [event.text for event in limits.report(1.0, np.array([True]))]
    ['inv1 limits its phase currents to 2 pu']
    >>> limits.report(1.002, np.array([True]))
    []
    """

    def __init__(self, names: tuple[str, ...], I_max: tuple[float, ...]) -> None:
        self._names, self._I_max = names, I_max
        self._last = [-np.inf] * len(names)

    def report(self, t: float, limiting: NDArray[np.bool_]) -> list[PlantEvent]:
        """Return the events of spells that begin at t (s), given which inverters limit."""
        events = []
        for i in np.flatnonzero(limiting).tolist():
            name, since = self._names[i], t - self._last[i]
            self._last[i] = t
            if since > PAUSE:
                text = f"{name} {LIMITS} to {self._I_max[i]:g} pu"
                events.append(PlantEvent(t=t, kind="limit", subject=name, text=text))
        return events
