"""Rows of the plant in a record: the last one at a time, and the points of the strips before it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from functools import lru_cache

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.viewer.run_view import FROZEN
from gridpeers.viewer.strips import LENGTH, Point, next_due, point_of
from gridpeers.wire.messages import Telemetry

LENGTHS = (LENGTH / 4.0, LENGTH / 2.0, LENGTH)
"""Lengths of strips (s): a record that is shorter than the last has more points a second."""

KEPT = 400
"""Parts whose points are kept: two strips of a run in real time."""


class PlantRows:
    """Read rows by time; the configuration of each inverter gives per-unit values."""

    def __init__(self, record: RunRecord, configs: Mapping[str, AgentConfig]) -> None:
        self._record, self._index, self._configs = record, record.index, configs
        plant = record.info.plant
        self.longest_gap = max(FROZEN * max(1.0, plant.speed), 1.5 * plant.record_step)
        """Longest run time (s) between two rows. After it a row is missing, or in real time the plant is frozen."""
        self._rows_in = lru_cache(maxsize=8)(self._read_rows)
        self._points_in = lru_cache(maxsize=KEPT)(self._read_points)

    def last(self, t: float) -> tuple[tuple[str, ...], tuple[float, ...]] | None:
        """Return the inverters and the last row up to a run time (s); None if there is none shortly before."""
        found = None
        for part in self._index.near(t - max(1.0, self.longest_gap), t):
            inverters, rows = self._rows_in(part)
            at = bisect_right(rows, t + 1e-9, key=lambda row: row[0]) - 1
            if at >= 0 and (found is None or rows[at][0] > found[1][0]):
                found = inverters, rows[at]
        return found

    def points(self, since: float, until: float) -> list[Point]:
        """Return the points of the strips after a run time (s) up to another one, the last one exactly there."""
        length = next((length for length in LENGTHS if self._record.t_end <= length), LENGTHS[-1])
        points = [
            point
            for part in self._index.near(since, until)
            for point in self._points_in(part, length)
            if since + 1e-9 < point[0] <= until + 1e-9
        ]
        points.sort(key=lambda point: point[0])
        last = self.last(until)
        if last is not None and last[1][0] > max(since, points[-1][0] if points else since) + 1e-9:
            points.append(point_of(*last, self._configs))
        return points

    def _read_rows(self, part: int) -> tuple[tuple[str, ...], list[tuple[float, ...]]]:
        inverters: tuple[str, ...] = ()
        rows: list[tuple[float, ...]] = []
        for message in self._index.of_type("telemetry", Telemetry, (part,)):
            inverters = message.inverters
            rows += message.rows
        rows.sort(key=lambda row: row[0])
        return inverters, rows

    def _read_points(self, part: int, length: float) -> list[Point]:
        inverters, rows = self._rows_in(part)
        points: list[Point] = []
        due = 0.0
        for row in rows:
            if row[0] + 1e-9 >= due:
                points.append(point_of(inverters, row, self._configs))
                due = next_due(row[0], len(inverters), length)
        return points
