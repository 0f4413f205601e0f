"""Report when the voltage of loads crosses a limit at which their law jumps, so that their power changes at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.limited_load import COLUMNS, limited_admittance
from gridpeers.plant.network import Network
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import first_of

PAUSE = 0.5
"""Time (s) without a crossing after which a load's next crossing is reported: once per spell of an oscillation."""

SHOWN = 3
"""Loads that an event names."""

BESIDE = 1e-9
"""Distance from a limit, in proportion, at which the law beside it is taken; a jump is larger by far."""

LIMITS = {"V_min": -1, "V_max": 1}
"""Limits of a load's law, and the side on which a load is beyond them: below or above."""


class _Jump(NamedTuple):
    """A limit of a load branch at which its law jumps."""

    name: str
    """Name of its load."""
    branch: int
    V: float
    """The limit (V)."""
    limit: str
    """Its name, of `LIMITS`."""
    S: tuple[float, float]
    """Apparent power (VA) just within the limit and just beyond it."""


class LoadLimits:
    """Loads of an imported feeder whose law jumps at V_min or V_max, as that of OpenDSS's models 3, 4 and 6 does.

    Parameters
    ----------
    network
        The feeder's network.
    V
        Voltages across its load branches at the start (V).
    """

    def __init__(self, network: Network, V: NDArray[np.complex128]) -> None:
        self._jumps = _jumps(network)
        self.any = bool(self._jumps)
        """Whether a load has such a limit."""
        self._branches = np.array([jump.branch for jump in self._jumps], np.int64)
        self._V = np.array([jump.V for jump in self._jumps])
        self._side = np.array([LIMITS[jump.limit] for jump in self._jumps])
        self._beyond = self._are_beyond(np.abs(V[self._branches]))
        self._last: dict[str, float] = {}

    def report(self, t: float, V: NDArray[np.complex128]) -> list[PlantEvent]:
        """Return events for the loads that crossed a limit since the last call, at these voltages (V) of all branches.

        There is one for each limit and direction. A load without voltage stays as it was.
        """
        magnitude = np.abs(V[self._branches])
        now = np.where(magnitude > 0.0, self._are_beyond(magnitude), self._beyond)
        groups: dict[tuple[str, bool], list[_Jump]] = {}
        for k in np.flatnonzero(now != self._beyond).tolist():
            groups.setdefault((self._jumps[k].limit, bool(now[k])), []).append(self._jumps[k])
        self._beyond = now
        return [
            event
            for (limit, beyond), jumps in groups.items()
            for event in self._events(t, limit, beyond=beyond, jumps=jumps)
        ]

    def _are_beyond(self, magnitude: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(self._side * (magnitude - self._V) > 0.0)

    def _events(self, t: float, limit: str, *, beyond: bool, jumps: list[_Jump]) -> list[PlantEvent]:
        crossed = dict.fromkeys(jump.name for jump in jumps)
        names = [name for name in crossed if t - self._last.get(name, -np.inf) > PAUSE]
        self._last.update(dict.fromkeys(crossed, t))
        if not names:
            return []
        within, outside = (sum(jump.S[k] for jump in jumps if jump.name in names) for k in (0, 1))
        change = (outside - within if beyond else within - outside) / (within if beyond else outside)
        way = "rises above" if (LIMITS[limit] > 0) == beyond else "falls below"
        text = (
            f"voltage of {first_of(names, SHOWN)} {way} {limit}, where the law of such a load jumps: "
            f"{abs(change):.0%} {'more' if change > 0.0 else 'less'} apparent power at once"
        )
        return [PlantEvent(t=t, kind="limit", subject=names[0], text=text)]


def _jumps(network: Network) -> list[_Jump]:
    """Return the limits of a network's loads at which their law jumps."""
    law = network.loads().law
    names = [part.name for part in network.feeder.load_parts if not part.is_impedance]
    found = []
    for name, branch, row in zip(names, law.limited_at.tolist(), law.law, strict=True):
        for limit, side in LIMITS.items():
            if V := float(row[COLUMNS.index(limit)]):
                within, beyond = (abs(limited_admittance(row, V * (1.0 + k * BESIDE))[0]) * V**2 for k in (-side, side))
                if abs(beyond - within) > 1e3 * BESIDE * within:
                    found.append(_Jump(name, branch, V, limit, (within, beyond)))
    return found
