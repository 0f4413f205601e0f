"""Windows of measurement of a live run: of its scenario's events, and of people's on switches and loads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from gridpeers.scenarios.results.event_windows import Window, as_they_came, windows
from gridpeers.scenarios.results.steadiness import STEADY
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.wire.messages import PlantEvent

NEAR = 1e-9
"""Times (s) that differ by less are the same: they are multiples of the plant's step."""


@dataclass(frozen=True, kw_only=True)
class LiveWindows:
    """The windows of a live run, each kind in the order of time."""

    measured: tuple[Window, ...]
    """Windows with numbers: each lasts to the next event, of the scenario or live."""
    too_short: tuple[Window, ...]
    """Windows that the next event ended before the values could be steady."""
    not_reached: tuple[Window, ...]
    """Windows of the scenario whose end the run did not reach."""
    unrecorded: tuple[Window, ...]
    """Windows without numbers, as rows are missing at their end, where they are measured."""


def live_events(done: Iterable[PlantEvent]) -> tuple[tuple[str, float], ...]:
    """Return label and time (s) of each event that people made on switches and loads; those of one step are one event.

    Examples
    --------
    >>> live_events([PlantEvent(t=2.5, kind="switch", subject="67s-67", text="switch sw1_2 (67s-67) opened")])
    (('live at 2.5 s', 2.5),)
    """
    return tuple((f"live at {round(t, 3):.12g} s", t) for t in dict.fromkeys(event.t for event in done))


def live_windows(
    scenario: ScenarioModel,
    events: Iterable[PlantEvent],
    live: Sequence[tuple[str, float]],
    ended: float,
    missing: Sequence[tuple[float, float]] = (),
) -> LiveWindows:
    """Return the windows of a live run.

    A live event opens a window as the scenario's events do, and ends the one before it. Its own window lasts to the
    next event or to the end of the run, whatever the scenario says of its end. A switch operated at the moment of an
    event of the scenario belongs to the window of that event.

    Parameters
    ----------
    scenario : ScenarioModel
        As run.
    events : Iterable[PlantEvent]
        The plant's events.
    live : Sequence[tuple[str, float]]
        Label and time (s) of the live events, in the order of time.
    ended : float
        Time (s) of the last row.
    missing : Sequence[tuple[float, float]], optional
        Times (s) of the rows before and after each interval without rows.
    """
    meant = windows([(event.label, event.t_s) for event in scenario.events], scenario.time.end_s)
    scripted = windows(as_they_came(scenario, events), scenario.time.end_s)
    starts = [window.start for window in scripted]
    live = [(label, t) for label, t in live if all(abs(t - start) > NEAR for start in starts)]
    reached, not_reached = [], []
    for plan, window in zip(meant, scripted, strict=True):
        cut = [t for _, t in live if window.start < t < window.end - NEAR]
        if cut or plan.end <= ended + NEAR:
            reached.append(replace(window, end=cut[0]) if cut else window)
        else:
            not_reached.append(plan)
    starts += [t for _, t in live]
    for label, t in live:
        end = min((start for start in starts if start > t), default=ended)
        reached.append(Window(label=label, start=t, end=min(end, ended)))
    reached.sort(key=lambda window: window.start)
    shortest = max(STEADY, 2.0 * scenario.time.record_s) - NEAR
    too_short = [one for one in reached if one not in scripted and one.end - one.start < shortest]
    unrecorded = [
        one
        for one in reached
        if one not in too_short and any(a < one.end and b > one.end - STEADY - NEAR for a, b in missing)
    ]
    return LiveWindows(
        measured=tuple(one for one in reached if one not in too_short and one not in unrecorded),
        too_short=tuple(too_short),
        not_reached=tuple(not_reached),
        unrecorded=tuple(unrecorded),
    )
