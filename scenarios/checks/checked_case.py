"""A recorded case, as metrics and checks get it: rows, windows, islands, events, messages and decisions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.checks.check_registry import READERS
from gridpeers.scenarios.checks.check_verdict import NotJudgedError, Violation
from gridpeers.scenarios.results.history import Flags, History, Nameplates, Window, messages_saved, read_only, windows
from gridpeers.scenarios.results.island_membership import (
    IslandInterval,
    island_intervals,
    islands_at_end,
    part_of,
    taken_part,
)
from gridpeers.scenarios.results.metrics import STEADY
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.schema.configs import limits_of
from gridpeers.scenarios.schema.participants import netem_of, without_agent
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.messages import PlantEvent

NEAR = 0.02  # Part of its available power within which an inverter counts as at that limit

_RESTARTS = ("switch", "inverter", "load")
"""Kinds of events from which on a window settles anew: a switch that waited for synchronism, an inverter that was
connected later than the scenario says, a load that somebody changed."""


@dataclass(frozen=True)
class IslandWindow:
    """One island in the window of one event: its own columns of the window's rows."""

    window: Window
    label: str
    """Label of the event, with the island where there are several."""
    fed: bool
    """True if the substation feeds it: secondary control is on hold then."""
    history: History
    nameplates: Nameplates

    def violation(
        self, text: str, i: int, value: float, limit: float, unit: str = "", t: float | None = None
    ) -> Violation:
        """Return a violation by the inverter of column i at a time (s), by default the end of the window."""
        at, name = self.window.end if t is None else float(t), self.history.inverters[i]
        return Violation(text=text, t=at, agent=name, value=float(value), unit=unit, limit=limit)


@dataclass(frozen=True, kw_only=True)
class CheckedCase:
    """A recorded case, as a check gets it; it is read-only."""

    scenario: ScenarioModel
    """Scenario of the run, as typed values."""
    feeder: Tables
    case: str
    history: History
    """All rows, as read-only arrays of shape (rows, inverters)."""
    windows: Sequence[Window]
    events: Sequence[PlantEvent]
    """Events of plant, roster and links, in the order of time."""
    messages_saved: Mapping[str, float] = field(default_factory=dict)
    """Share of states that the laws did not send, by window; empty if they sent all states."""
    folder: Path | None = None
    """Folder with the record run.mcap; None for a run in memory."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "history", read_only(self.history))

    @classmethod
    def of(
        cls, scenario: ScenarioModel, feeder: Tables, case: str, recorded: Recorded, folder: Path | None = None
    ) -> CheckedCase:
        """Return a case as recorded, with the windows that can be measured."""
        came = _measurable(scenario, recorded)
        return cls(
            scenario=scenario,
            feeder=feeder,
            case=case,
            history=taken_part(scenario, feeder, recorded.history),
            windows=came,
            events=recorded.events,
            messages_saved=messages_saved(scenario, feeder, case, recorded.quiet, came),
            folder=folder,
        )

    @cached_property
    def communication(self) -> Any:
        """Findings of one pass over messages and decisions of the record; `NotJudgedError` without a record."""
        return self._read("communication")

    @cached_property
    def content(self) -> Any:
        """States, decisions and accounts of links from the record; `NotJudgedError` without them."""
        return self._read("content")

    def _read(self, reader: str) -> Any:
        from gridpeers.scenarios.record.record_file import RecordFileError
        from gridpeers.scenarios.record.record_info import FILE

        if self.folder is None or not (self.folder / FILE).exists():
            raise NotJudgedError("the run has no record run.mcap")
        try:
            return READERS.resolve(reader)(self.folder / FILE)
        except RecordFileError as error:
            raise NotJudgedError(str(error)) from error

    @cached_property
    def nameplates(self) -> Nameplates:
        """Nameplates in the order of the columns, with a flag for inverters without an agent, which do not share."""
        everybody = Nameplates.of_columns(self.history.inverters, self.feeder)
        return read_only(everybody.without(without_agent(self.scenario, self.case)))

    @property
    def f_nom(self) -> float:
        return self.feeder.f_nom

    @property
    def T_c(self) -> float:
        return self.scenario.time.T_c_s

    def disturbed_at(self, window: Window) -> float:
        """Return the time (s) of the last switching or connection in a window, from which it settles."""
        times = [e.t for e in self.events if e.kind in _RESTARTS and window.start - 1e-9 <= e.t < window.end]
        return max((window.start, *times))

    def rows_from(self, part: IslandWindow, after_s: float, since_s: float = 0.0) -> Flags:
        """Return the rows of a part from `after_s` after the last disturbance of its window, and after `since_s`."""
        late: Flags = part.history.t >= max(self.disturbed_at(part.window), since_s) + after_s - 1e-9
        return late

    @cached_property
    def islands(self) -> tuple[IslandInterval, ...]:
        return island_intervals(self.scenario, self.feeder, self.history.inverters, self.events)

    def seen_by(self, window: Window) -> History:
        """Return the rows from which a window is cut: a live run may go on after the end of the scenario."""
        end = self.scenario.time.end_s
        return read_only(self.history.until(end)) if window.end <= end < self.history.t[-1] else self.history

    @cached_property
    def parts(self) -> Mapping[Window, Sequence[IslandWindow]]:
        """Islands with inverters at the end of each window (`islands_at_end`).

        An island that forms within the window is judged from then on (`rows_from`).
        """
        return {window: self._parts_of(window) for window in self.windows}

    def _parts_of(self, window: Window) -> list[IslandWindow]:
        rows, found = window.cut(self.seen_by(window)), []
        for name, island in (at_end := islands_at_end(self.islands, window)).items():
            label = window.label + (f", island of {name}" if len(at_end) > 1 else "")
            found.append(IslandWindow(window, label, island.fed, *part_of(rows, self.nameplates, island.inverters)))
        return found

    @property
    def unmeasured(self) -> list[str]:
        """Labels of the events whose windows cannot be measured."""
        measured = {window.label for window in self.windows}
        return [event.label for event in self.scenario.events if event.label not in measured]

    def killed(self, history: History) -> Flags:
        """Return by row, as an array (rows, inverters), the inverters whose agent the scenario has killed."""
        names = history.inverters
        found: Flags = np.zeros(history.P.shape, bool)
        for node in netem_of(self.scenario, self.case).nodes:
            if node.kill and node.name in names:
                found[history.t >= node.from_s - 1e-9, names.index(node.name)] = True
        return found

    def at_limit(self, part: IslandWindow) -> Flags:
        """Return by row, as an array (rows, inverters), the inverters of an island at the limit of an event."""
        names = part.history.inverters
        found: Flags = np.zeros(part.history.P.shape, bool)
        for limit in limits_of(self.scenario, self.case):  # in the order of time: a later one replaces an earlier one
            if limit.inverter in names:
                i = names.index(limit.inverter)
                since = part.history.t >= limit.t - 1e-9
                found[since, i] = part.history.P[since, i] >= (1.0 - NEAR) * limit.P_max
        return found


def _measurable(scenario: ScenarioModel, recorded: Recorded) -> list[Window]:
    """Return the windows of the events as they came, up to the end of the record.

    One that the record ends within 0.2 s of its start is left out, and one without rows at its end.
    """
    least, found = max(STEADY, 2.0 * scenario.time.record_s), list[Window]()
    for window in windows(scenario, recorded.events):
        if window.end > recorded.ended + 1e-9:
            window = replace(window, end=recorded.ended)
            if window.end - window.start < least - 1e-9:
                continue
        if not any(a < window.end and b > window.end - STEADY - 1e-9 for a, b in recorded.missing):
            found.append(window)
    return found
