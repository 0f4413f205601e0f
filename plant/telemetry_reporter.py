"""Messages of the plant: measurements for its agents, telemetry for recorders. The same in both kinds of time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import get_type_hints

from msgspec.structs import replace

from gridpeers.plant.plant_interface import PlantLike, ReadingLike
from gridpeers.wire.messages import PLANT, VALUES, Measurement, Pacing, PlantEvent, Telemetry
from gridpeers.wire.wording import printable

_NUMBER_BYTES = 9
"""Bytes of one float in msgpack."""


def measurement_of(
    name: str, reading: ReadingLike, *, epoch: int, tick: int, t: float, roster: tuple[str, ...] | None = None
) -> Measurement:
    """Return the measurement of one inverter (t in s) from its reading, within the range of a sensor.

    Beyond its range a sensor shows the end of its scale. So a plant that swings wildly still grants its ticks; the
    telemetry has the true values.
    """
    return Measurement(
        sender=PLANT,
        epoch=epoch,
        seq=tick,
        t=t,
        to=name,
        P=_in_W(reading.P),
        Q=_in_W(reading.Q),
        V=_in_V(reading.V),
        f=_in_Hz(reading.f),
        P_set=_in_W(reading.P_set),
        V_set=_in_V(reading.V_set),
        grid_connected=reading.grid_connected,
        island=reading.island,
        roster=roster,
    )


def _scale(field: str) -> Callable[[float], float]:
    """Return the scale of a sensor, which clips to the bounds of a measurement's field."""
    bounds = get_type_hints(Measurement, include_extras=True)[field].__metadata__[0]
    low, high = float(bounds.ge), float(bounds.le)
    return lambda value: value if low <= value <= high else min(max(value, low), high)


_in_W, _in_V, _in_Hz = _scale("P"), _scale("V"), _scale("f")

_LATEST = 20
"""Number of latest events for late clients: with twice as many of the longest, an answer is still short."""


ROWS_BYTES = 32_000
"""Bytes of rows in a message: Zenoh sends it in one piece."""

EVENTS = 30
"""Most events in a message; the longest possible ones fit within the limit."""


class Reporter:
    """Gather rows and events between two reports.

    Parameters
    ----------
    epoch : int
        Epoch of the plant.
    plant : PlantLike
        Source of the rows.
    """

    def __init__(self, epoch: int, plant: PlantLike) -> None:
        self._epoch, self._plant = epoch, plant
        self._rows: list[tuple[float, ...]] = []
        self._events: list[PlantEvent] = []
        self._quiet: dict[float, int] = {}
        """Number of quiet states, by run time (s)."""
        self.seq = 0
        """Number of the next Telemetry, or of the one under way."""
        self.latest: deque[PlantEvent] = deque(maxlen=_LATEST)
        """The latest events, for late clients."""

    @property
    def has_events(self) -> bool:
        """Whether events wait for the next report."""
        return bool(self._events)

    def collect(self) -> None:
        """Take the plant's new rows and events."""
        self._rows += self._plant.take_rows()
        for event in self._plant.take_events():
            self.note(event)

    def note(self, event: PlantEvent) -> None:
        """Add an event."""
        event = replace(event, subject=printable(event.subject, 200), text=printable(event.text))
        self._events.append(event)
        self.latest.append(event)

    def note_quiet(self, t: float) -> None:
        """Count a quiet state at run time t (s)."""
        self._quiet[t] = self._quiet.get(t, 0) + 1

    def report(
        self,
        t: float,
        *,
        final: bool,
        outcome: str,
        reproducible: bool,
        pacing: Pacing | None = None,
        awaited: tuple[str, ...] = (),
        impaired: tuple[str, ...] = (),
        others: int = 0,
    ) -> Iterator[Telemetry]:
        """Yield telemetry at run time t (s) of all gathered rows and events, in messages within the size limit."""
        inverters = self._plant.inverters
        bytes_per_row = _NUMBER_BYTES * (1 + VALUES * len(inverters)) + 8
        at_once = max(1, ROWS_BYTES // bytes_per_row)
        rows, events, quiet = self._rows, self._events, tuple(self._quiet.items())
        self._rows, self._events, self._quiet = [], [], {}
        while True:
            part, rows = rows[:at_once], rows[at_once:]
            told, events = ([], events) if rows else (events[:EVENTS], events[EVENTS:])
            more = bool(rows or events)
            yield Telemetry(
                sender=PLANT,
                epoch=self._epoch,
                seq=self.seq,
                t=t,
                inverters=inverters,
                rows=tuple(part),
                events=tuple(told),
                final=final and not more,
                outcome=printable(outcome),
                reproducible=reproducible,
                pacing=pacing,
                awaited=() if more else awaited,
                impaired=impaired,
                others=others,
                quiet=() if more else quiet,
            )
            others = 0
            self.seq += 1
            if not more:
                return
