"""Windows of measurement: the time from each event to the next, and a recorded case with its windows and events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.results.history import Flags, Floats, History, history_of
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.schema.participants import with_agent
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.messages import PlantEvent


@dataclass(frozen=True, kw_only=True)
class Window:
    """Time that belongs to one event."""

    label: str
    start: float
    """Time of the event (s)."""
    end: float
    """Time of the next one, or the end of the run (s)."""

    def rows(self, t: Floats) -> Flags:
        """Return the rows after the event and before the next one; a run's last row belongs to its last window.

        Rows at the very moments of events are left out: they belong to both sides.
        """
        tolerance = 1e-9
        last = bool(t.size) and self.end >= t[-1] - tolerance
        rows: Flags = (t > self.start + tolerance) & (t < self.end + (tolerance if last else -tolerance))
        return rows

    def cut(self, history: History) -> History:
        """Return the rows of a history that are of this window."""
        return history.rows(self.rows(history.t))


def windows(events: Sequence[tuple[str, float]], end: float) -> tuple[Window, ...]:
    """Return the windows of events given as (label, time in s)."""
    ends = [*(t for _, t in events), end][1:]
    return tuple(Window(label=label, start=t, end=stop) for (label, t), stop in zip(events, ends, strict=True))


def as_they_came(scenario: ScenarioModel, recorded: Iterable[PlantEvent]) -> list[tuple[str, float]]:
    """Return label and time (s) of each event: the scenario's time, or that at which its last inverter moved.

    In wall-clock time a process takes its time to start, and inverters join later than the scenario says.
    """
    moved = [(event.t, event.subject) for event in recorded if event.kind == "inverter"]
    ends = [*(event.t_s for event in scenario.events), scenario.time.end_s][1:]
    came = []
    for event, end in zip(scenario.events, ends, strict=True):
        names = {*event.leave, *event.join}
        times = [t for t, name in moved if name in names and event.t_s - 1e-9 <= t < end]
        came.append((event.label, max(times, default=event.t_s)))
    return came


def late_moves(scenario: ScenarioModel, recorded: Iterable[PlantEvent]) -> list[str]:
    """Return sentences on events that came later than the scenario says, as processes, or people, took their time."""
    came = as_they_came(scenario, recorded)
    return [
        f"{event.label}, meant for t = {event.t_s:g} s, came at {t:g} s, when the last of its agents had moved; "
        "what is measured of it begins there"
        for event, (_, t) in zip(scenario.events, came, strict=True)
        if t > event.t_s + 1e-9
    ]


def messages_saved(
    quiet: Iterable[tuple[float, int]], windows: Sequence[Window], agents: int, T_c: float
) -> dict[str, float]:
    """Return the share of states that the laws did not send, by window; nothing if they sent all."""
    quiet = list(quiet)
    if not quiet:
        return {}
    near = 0.5 * T_c
    saved = {}
    for window in windows:
        count = sum(n for t, n in quiet if window.start - near <= t < window.end - near)
        saved[window.label] = count / (agents * max(1, round((window.end - window.start) / T_c)))
    return saved


@dataclass(frozen=True, kw_only=True)
class CaseRecord:
    """One recorded case, and the windows in which it is measured."""

    history: History
    windows: Sequence[Window]
    events: Sequence[PlantEvent]
    """Recorded events, in the order of time: their switches make the islands."""
    messages_saved: Mapping[str, float] = field(default_factory=dict)
    """Share of states that the laws did not send, by window; empty if they sent all."""

    @classmethod
    def of(
        cls, scenario: ScenarioModel, feeder: Feeder, case: str, of: Recorded, opened: Sequence[Window] | None = None
    ) -> CaseRecord:
        """Return a case as recorded, with given windows, or with those of the scenario's events as they came."""
        if opened is None:
            opened = windows(as_they_came(scenario, of.events), scenario.time.end_s)
        saved = messages_saved(of.quiet, opened, len(with_agent(scenario, feeder, case)), scenario.time.T_c_s)
        return cls(history=history_of(of), windows=opened, events=of.events, messages_saved=saved)
