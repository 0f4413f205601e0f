"""Messages of the plant: measurements for its agents, telemetry for recorders, kept until they have it. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import takewhile
from typing import get_type_hints

from msgspec.structs import replace

from gridpeers.plant.plant_interface import PlantLike, Reading
from gridpeers.wire.messages import PLANT, VALUES, Measurement, Pacing, PlantEvent, Telemetry
from gridpeers.wire.wording import printable

_NUMBER_BYTES = 9  # bytes of one float in msgpack


def measurement_of(
    name: str, reading: Reading, *, epoch: int, tick: int, t: float, roster: tuple[str, ...] | None = None
) -> Measurement:
    """Return the measurement of one inverter (t in s) from its reading, within the range of a sensor.

    Beyond its range a sensor shows the end of its scale, so a plant that swings wildly still grants its ticks.
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
    bounds = get_type_hints(Measurement, include_extras=True)[field].__metadata__[0]
    low, high = float(bounds.ge), float(bounds.le)
    return lambda value: value if low <= value <= high else min(max(value, low), high)


_in_W, _in_V, _in_Hz = _scale("P"), _scale("V"), _scale("f")
_LATEST = 20  # number of latest events for late clients: with twice as many of the longest, an answer is still short
ROWS_BYTES = 32_000  # bytes of rows in a message: Zenoh sends it in one piece
EVENTS = 30  # most events in a message; the longest possible ones fit within the limit


class Reporter:
    """Gather rows and events between two reports."""

    def __init__(self, epoch: int, plant: PlantLike) -> None:
        self._epoch, self._plant = epoch, plant
        self._rows: list[tuple[float, ...]] = []
        self._events: list[PlantEvent] = []
        self._quiet: dict[float, int] = {}  # number of quiet states, by run time (s)
        self.seq = 0  # number of the next Telemetry, or of the one under way
        self.latest: deque[PlantEvent] = deque(maxlen=_LATEST)  # the latest events, for late clients

    @property
    def has_events(self) -> bool:
        return bool(self._events)

    def collect(self) -> None:
        self._rows += self._plant.take_rows()
        for event in self._plant.take_events():
            self.note(event)

    def note(self, event: PlantEvent) -> None:
        event = replace(event, subject=printable(event.subject, 200), text=printable(event.text))
        self._events.append(event)
        self.latest.append(event)

    def note_quiet(self, t: float) -> None:
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


WINDOW = 1_000_000
"""Bytes without acknowledgement beyond which the plant waits before its next tick: a loopback link holds as many when
nobody reads it, so Zenoh does not close it before."""


BLOCK = 1 << 20
"""Bytes of a block of kept messages: kept one by one, they leave the heap full of holes (40 MB in a live run)."""


class KeptTelemetry:
    """Messages on the key of telemetry, in their order.

    Each has the number of a Telemetry: its own, or that of the next one for a message between two of them.
    """

    def __init__(self) -> None:
        self._kept: deque[tuple[int, memoryview]] = deque()
        self._room = memoryview(bytearray())  # what is left of the last block
        self.bytes = 0

    def keep(self, number: int, payload: bytes) -> None:
        size = len(payload)
        if size > len(self._room):
            self._room = memoryview(bytearray(max(BLOCK, size)))
        self._room[:size] = payload
        self._kept.append((number, self._room[:size]))
        self._room = self._room[size:]
        self.bytes += size

    def drop_before(self, number: int) -> None:
        while self._kept and self._kept[0][0] < number:
            self.bytes -= len(self._kept.popleft()[1])

    def others(self, number: int) -> int:
        """Return the number of messages that count to a Telemetry that is yet to be kept."""
        return sum(1 for _ in takewhile(lambda message: message[0] == number, reversed(self._kept)))


class UnacknowledgedTelemetry(KeptTelemetry):
    """Messages for the recorders that a run waits for; without any, nothing is kept."""

    def __init__(self, recorders: Iterable[str]) -> None:
        super().__init__()
        self._needed = dict.fromkeys(recorders, 0)  # number of the Telemetry that each recorder needs next

    def keep(self, number: int, payload: bytes) -> None:
        if self._needed:
            super().keep(number, payload)

    def acknowledged(self, recorder: str, number: int) -> list[bytes] | None:
        """Take a recorder's word that it has all before a number; return what to publish again, None if it is news."""
        again = number <= self._needed[recorder]
        self._needed[recorder] = max(number, self._needed[recorder])
        self.drop_before(min(self._needed.values()))
        return [bytes(payload) for its, payload in self._kept if its >= number] if again else None

    @property
    def is_full(self) -> bool:
        return self.bytes > WINDOW

    @property
    def is_empty(self) -> bool:
        return not self._kept
