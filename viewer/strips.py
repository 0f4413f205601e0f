"""The last seconds of a run as strips: f, P, Q and V of each inverter, MPSI and MQSI. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from itertools import takewhile
from math import isfinite

import numpy as np

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.results.sharing_index import sharing_index
from gridpeers.wire.messages import VALUES

LENGTH = 30.0

STEP = 0.05
"""Run time (s) between two points at the least: more than a strip of 600 pixels can show."""

MANY, WIDE_STEP = 30, 0.1
"""Inverters beyond which there are half as many points."""

Point = tuple[float, tuple[float | None, ...]]
"""Run time (s); then f (Hz), P (pu of the rating), Q (pu of the rating) and V (pu) of each inverter, all f first; then
MPSI and MQSI over all inverters on the network, whatever their islands. None stands for a value that is not known, not
finite, or of an inverter off the network."""


class Strips:
    """Keep points of the last `LENGTH` seconds."""

    def __init__(self) -> None:
        self._points: deque[Point] = deque()
        self._due = 0.0

    def clear(self) -> None:
        self._points.clear()
        self._due = 0.0

    def add(
        self, inverters: tuple[str, ...], rows: Sequence[tuple[float, ...]], configs: Mapping[str, AgentConfig]
    ) -> None:
        for row in rows:
            if row[0] + 1e-9 >= self._due:
                self._due = next_due(row[0], len(inverters))
                self._points.append(point_of(inverters, row, configs))
        while self._points and self._points[0][0] < self._points[-1][0] - LENGTH:
            self._points.popleft()

    def since(self, t: float) -> list[Point]:
        return [*takewhile(lambda point: point[0] > t, reversed(self._points))][::-1]


def next_due(t: float, inverters: int, length: float = LENGTH) -> float:
    """Return the run time (s) of the next point after one at t (s): of so many inverters, on strips of a length (s)."""
    step = (STEP if inverters <= MANY else WIDE_STEP) * length / LENGTH
    return (int(t / step + 1e-6) + 1) * step


def point_of(inverters: tuple[str, ...], row: tuple[float, ...], configs: Mapping[str, AgentConfig]) -> Point:
    f, P, Q, V = (np.array(row[1 + i :: VALUES]) for i in range(4))
    present = (P != 0.0) | (Q != 0.0)  # the plant reports exactly no power of an inverter that is off the network
    known = [configs.get(name) for name in inverters]
    rated = np.array([np.nan if config is None else config.P_rated for config in known])
    V_nom = np.array([np.nan if config is None else config.V_nom for config in known])
    indices = [np.nan, np.nan]
    if all(known):
        droops = [np.array([getattr(config, name) for config in known]) for name in ("m_p", "m_q")]
        indices = [
            float(sharing_index(x[None, :], rated, m, present[None, :])[0]) for x, m in zip((P, Q), droops, strict=True)
        ]
    columns = np.concatenate([np.where(present, x, np.nan) for x in (f, P / rated, Q / rated, V / V_nom)])
    values = tuple(round(value, 4) if isfinite(value) else None for value in (*columns.tolist(), *indices))
    return round(row[0], 4), values
