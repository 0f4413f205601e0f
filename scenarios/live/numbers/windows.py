"""Windows of measurement of a live run: of its scenario's events, and of switches that people operated. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from scenarios.results.event_windows import Window, windows
from scenarios.results.steadiness import STEADY
from scenarios.schema import ScenarioModel
from scenarios.schema.scenario_model import Event
from wire.messages import PlantEvent

NEAR = 1e-9
"""Times (s) that differ by less are the same: they are multiples of the plant's step."""


@dataclass(frozen=True, kw_only=True)
class LiveWindows:
    """The windows of a live run, each kind in the order of time."""

    measured: tuple[Window, ...]
    """Windows with numbers: each lasts to the next event, of the scenario or by hand."""
    too_short: tuple[Window, ...]
    """Windows that the next event ended before the values could be steady."""
    not_reached: tuple[Window, ...]
    """Windows of the scenario whose end the run did not reach."""


def events_by_hand(switched: Iterable[PlantEvent]) -> tuple[Event, ...]:
    """Return the operations of switches as events of a scenario; operations in one step are one event.

    Parameters
    ----------
    switched : Iterable[PlantEvent]
        Switches that people operated, in the order of time.

    Examples
    --------
    >>> told = PlantEvent(t=2.5, kind="switch", subject="67s-67", text="switch sw1_2 (67s-67) opened")
    >>> [(event.label, event.open, event.close) for event in events_by_hand([told])]
    [('by hand at 2.5 s', ('67s-67',), ())]
    """
    found = []
    for t, group in groupby(switched, key=lambda event: event.t):
        # several operations of a switch in one step come to what the last of them did
        last = {event.subject: event.text.endswith(" opened") for event in group}
        found.append(
            Event(
                label=f"by hand at {round(t, 3):.12g} s",
                t_s=t,
                open=tuple(name for name, opened in last.items() if opened),
                close=tuple(name for name, opened in last.items() if not opened),
            )
        )
    return tuple(found)


def opened(
    scenario: ScenarioModel, came: Sequence[tuple[str, float]], by_hand: Sequence[Event], ended: float
) -> LiveWindows:
    """Return the windows of a live run.

    An event by hand opens a window as the scenario's do, and ends the one before it. Its own lasts to the next event or
    to the end of the run, whatever the scenario says of its end. What was operated at the moment of an event of the
    scenario is part of that one's window.

    Parameters
    ----------
    scenario : ScenarioModel
        As run.
    came : Sequence[tuple[str, float]]
        Label and time (s) of each of its events, as it came.
    by_hand : Sequence[Event]
        What people did, in the order of time.
    ended : float
        Time (s) of the last row.
    """
    end_s, shortest = scenario.time.end_s, max(STEADY, 2.0 * scenario.time.record_s) - NEAR
    meant = windows([(event.label, event.t_s) for event in scenario.events], end_s)
    scripted = windows(came, end_s)
    starts = [window.start for window in scripted]
    mine = [event for event in by_hand if all(abs(event.t_s - t) > NEAR for t in starts)]
    found, not_reached = [], []
    for plan, window in zip(meant, scripted, strict=True):
        cut = [event.t_s for event in mine if window.start < event.t_s < window.end - NEAR]
        if cut:
            found.append(replace(window, end=cut[0]))
        elif plan.end <= ended + NEAR:
            found.append(window)
        else:
            not_reached.append(plan)
    starts += [event.t_s for event in mine]
    for event in mine:
        end = min((t for t in starts if t > event.t_s), default=ended)
        found.append(Window(label=event.label, start=event.t_s, end=min(end, ended)))
    found.sort(key=lambda window: window.start)
    whole = [window in scripted or window.end - window.start >= shortest for window in found]
    return LiveWindows(
        measured=tuple(window for window, enough in zip(found, whole, strict=True) if enough),
        too_short=tuple(window for window, enough in zip(found, whole, strict=True) if not enough),
        not_reached=tuple(not_reached),
    )
