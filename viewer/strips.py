"""The last seconds of a run as strips: f, P, Q and V of each inverter, MPSI and MQSI. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile
from math import isfinite

import numpy as np

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.results.sharing_index import Floats, sharing_index
from gridpeers.wire.messages import VALUES

LENGTH = 30.0

STEP = 0.05  # Run time (s) between two points at the least: more than a strip of 600 pixels can show

MANY, WIDE_STEP = 30, 0.1  # Inverters beyond which there are half as many points

Point = tuple[float, tuple[float | None, ...], dict[int, tuple[float, float]]]
"""Run time (s); then f (Hz), P (pu of the rating), Q (pu of the rating) and V (pu) of each inverter, all f first; then
MPSI and MQSI over all inverters on the network, whatever their islands. None stands for a value that is not known, not
finite, or of an inverter off the network. Last, by the number of a value, its lowest and highest one since the point
before, where they lie outside of both points: so a strip shows the extremes of each pixel."""


class Strips:
    """Keep points of the last `LENGTH` seconds."""

    def __init__(self) -> None:
        self._points: deque[Point] = deque()
        self.clear()

    def clear(self) -> None:
        self._points.clear()
        self._sampler = Sampler()

    def add(
        self, inverters: tuple[str, ...], rows: Sequence[tuple[float, ...]], configs: Mapping[str, AgentConfig]
    ) -> None:
        self._points += self._sampler.points(inverters, rows, configs)
        while self._points and self._points[0][0] < self._points[-1][0] - LENGTH:
            self._points.popleft()

    def since(self, t: float) -> list[Point]:
        return [*takewhile(lambda point: point[0] > t, reversed(self._points))][::-1]


class Sampler:
    """Make the points of strips of a length (s): one row each step, with the extremes of the rows before it."""

    def __init__(self, length: float = LENGTH) -> None:
        self._length = length
        self._due = 0.0
        self._last: Floats | None = None
        self._waiting: list[Floats] = []

    def points(
        self, inverters: tuple[str, ...], rows: Sequence[tuple[float, ...]], configs: Mapping[str, AgentConfig]
    ) -> Iterator[Point]:
        for row, values in zip(rows, _values_of(inverters, rows, configs), strict=True):
            self._waiting.append(values)
            if row[0] + 1e-9 >= self._due:
                step = (STEP if len(inverters) <= MANY else WIDE_STEP) * self._length / LENGTH
                self._due = (int(row[0] / step + 1e-6) + 1) * step
                yield self._point(row[0], values)

    def _point(self, t: float, values: Floats) -> Point:
        low, high = np.fmin.reduce(self._waiting), np.fmax.reduce(self._waiting)
        ends = [values] if self._last is None else [values, self._last]
        outside = (low < np.fmin.reduce(ends)) | (high > np.fmax.reduce(ends))
        outside |= np.isnan(values) & ~np.isnan(low)
        self._last, self._waiting = values, []
        beyond = {int(i): (float(low[i]), float(high[i])) for i in np.flatnonzero(outside)}
        return round(t, 4), tuple(value if isfinite(value) else None for value in values.tolist()), beyond


def _values_of(
    inverters: tuple[str, ...], rows: Sequence[tuple[float, ...]], configs: Mapping[str, AgentConfig]
) -> Floats:
    """Return the values of the points of some rows, shape (rows, values)."""
    table = np.array(rows, float).reshape(len(rows), 1 + VALUES * len(inverters))
    f, P, Q, V = (table[:, 1 + i :: VALUES] for i in range(4))
    present = (P != 0.0) | (Q != 0.0)  # the plant reports exactly no power of an inverter that is off the network
    known = [configs.get(name) for name in inverters]
    rated = np.array([np.nan if config is None else config.P_rated for config in known])
    V_nom = np.array([np.nan if config is None else config.V_nom for config in known])
    indices = np.full((2, len(rows)), np.nan)
    if all(known):
        droops = [np.array([getattr(config, name) for config in known]) for name in ("m_p", "m_q")]
        indices = np.array([sharing_index(x, rated, m, present) for x, m in zip((P, Q), droops, strict=True)])
    columns = [np.where(present, x, np.nan) for x in (f, P / rated, Q / rated, V / V_nom)]
    values = np.round(np.hstack([*columns, indices.T]), 4)
    values[~np.isfinite(values)] = np.nan
    return values
