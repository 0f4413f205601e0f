"""A plant, tick by tick: measured, held at set-points and advanced; what a run notes and reports of it. Pure.

Under both kinds of time, with messages (`gridpeers.plant.plant_node`) and without (`gridpeers.plant.direct_plant`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Literal, get_type_hints

from msgspec.structs import replace

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike, Reading
from gridpeers.wire.keys import check_name
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, VALUES, Measurement, Pacing, PlantEvent, State, Telemetry
from gridpeers.wire.timing import ticks_until, time_of
from gridpeers.wire.wording import printable

TELEMETRY_TICKS = 10  # ticks of simulated time between two telemetry messages: enough for a progress bar
ROWS_BYTES, _NUMBER_BYTES = 32_000, 9
"""Bytes of rows in a message, which Zenoh sends in one piece, and of one float in msgpack."""

EVENTS = 30  # most events in a message; the longest possible ones fit within the limit
LATEST = 20  # number of latest events for late clients: with twice as many of the longest, an answer is still short
IDLE = "; its agent is idle, its inverter stays on primary droop"  # end of the event of a law that failed


class PlantStepper:
    """ValueError if an agent of the configuration has no inverter, or the end is no multiple of the control period."""

    def __init__(self, config: PlantConfig, plant: PlantLike) -> None:
        for name in config.agents:
            check_name("agents", name)
            if name not in plant.inverters:
                raise ValueError(f'agents: no inverter "{name}"; inverters are {", ".join(plant.inverters)}')
        self.config = config
        self.inverters = tuple(plant.inverters)
        self.tick, self.t = 0, 0.0  # k, and k T_c (s): where the plant is
        self.broken = ""  # why the run cannot go on; empty while it can
        self.outcome = ""  # why the run broke; empty while it is sound
        self.cause: Exception | None = None  # error of the plant that broke the run, if any
        self.reproducible = config.clock == "simulated"
        self.telemetry_number = 0  # of the next Telemetry, or of the one under way
        self.latest: deque[PlantEvent] = deque(maxlen=LATEST)  # the latest events
        self._rows: list[tuple[float, ...]] = []
        self._events: list[PlantEvent] = []
        self._quiet: dict[float, int] = {}  # number of quiet states, by run time (s)
        self.plant = plant
        self.end_tick = None if config.end is None else ticks_until(config.end, config.T_c)
        self._failed_laws: dict[str, str] = {}  # by agent, why its law failed

    @property
    def at_end(self) -> bool:
        return self.tick == self.end_tick

    def measurements(self, names: Iterable[str], heard: tuple[str, ...] | None = None) -> Iterator[Measurement]:
        """Yield the measurements of inverters at this tick; `heard`: agents that the plant hears, in real time."""
        readings, tick, t, epoch = self.plant.measure(), self.tick, self.t, self.config.epoch
        for name in names:
            yield measurement_of(name, readings[name], epoch=epoch, tick=tick, t=t, roster=heard)

    def hear(self, state: State) -> None:
        """Note that the law of a state's sender failed, or does not send to the neighbours."""
        if state.fault:
            self._failed_laws.setdefault(state.sender, state.fault)
            self.note("law", state.sender, f"{state.sender}: {state.fault}{IDLE}")
        if state.quiet:
            self._quiet[self.t] = self._quiet.get(self.t, 0) + 1

    def law_failure(self) -> str:
        """Return why the run ends, if a law has failed and the scenario wants that; else an empty string."""
        failed = sorted(self._failed_laws, key=self.inverters.index)
        if not failed or self.config.on_law_failure != "stop":
            return ""
        more = f", and {len(failed) - 1} more" if len(failed) > 1 else ""
        why = f"{failed[0]}: {self._failed_laws[failed[0]]}{more}"
        return printable(f"ended at t = {self.t:g} s, as on_law_failure says: {why}")

    def advance(self) -> bool:
        """Go one tick on; return False if the plant cannot, and note why."""
        if not self._try(self.plant.advance):
            return False
        self.tick += 1
        self.t = time_of(self.tick, self.config.T_c)
        return True

    def connect(self, name: str, on: bool) -> bool:
        """Put an inverter on the network, or take it off; return False if the plant cannot, and note why."""
        return self._try(lambda: self.plant.connect(name, on))

    def collect(self, links: Links | None = None) -> None:
        """Take what the plant has recorded since, and which agents began or ended to lie by its time."""
        self._rows += self.plant.take_rows()
        for event in self.plant.take_events():
            self._note(event)
        for name, text in () if links is None else links.node_events(self.t):
            self.note("link", name, text)

    def note(self, kind: Literal["command", "law", "link", "roster", "warning"], subject: str, text: str) -> None:
        self._note(PlantEvent(t=self.t, kind=kind, subject=subject, text=text))

    @property
    def has_events(self) -> bool:
        """Whether events wait for the next report."""
        return bool(self._events)

    def report(
        self,
        *,
        final: bool = False,
        awaited: tuple[str, ...] = (),
        pacing: Pacing | None = None,
        impaired: tuple[str, ...] = (),
        others: int = 0,
    ) -> Iterator[Telemetry]:
        """Yield all rows and events since the last report, in messages within the size limit, with these fields."""
        self.collect()
        at_once = max(1, ROWS_BYTES // (_NUMBER_BYTES * (1 + VALUES * len(self.inverters)) + 8))
        rows, events, quiet = self._rows, self._events, tuple(self._quiet.items())
        self._rows, self._events, self._quiet = [], [], {}
        more = True
        while more:
            part, rows = rows[:at_once], rows[at_once:]
            told, events = ([], events) if rows else (events[:EVENTS], events[EVENTS:])
            more = bool(rows or events)
            yield Telemetry(
                sender=PLANT,
                epoch=self.config.epoch,
                seq=self.telemetry_number,
                t=self.t,
                inverters=self.inverters,
                rows=tuple(part),
                events=tuple(told),
                final=final and not more,
                outcome=printable(self.outcome),
                reproducible=self.reproducible,
                pacing=pacing,
                awaited=() if more else awaited,
                impaired=impaired,
                others=others,
                quiet=() if more else quiet,
            )
            others = 0
            self.telemetry_number += 1

    def _note(self, event: PlantEvent) -> None:
        event = replace(event, subject=printable(event.subject, 200), text=printable(event.text))
        self._events.append(event)
        self.latest.append(event)

    def _try(self, operation: Callable[[], object]) -> bool:
        try:
            operation()
        except RuntimeError as error:
            self.cause, self.broken = error, str(error) or type(error).__name__
        return not self.broken


_SENSED = Reading._fields[:6]
_HINTS = get_type_hints(Measurement, include_extras=True)
_SCALES = [(float(_HINTS[name].__metadata__[0].ge), float(_HINTS[name].__metadata__[0].le)) for name in _SENSED]
"""Both ends of the scale of each sensor."""


def measurement_of(
    name: str, reading: Reading, *, epoch: int, tick: int, t: float, roster: tuple[str, ...] | None = None
) -> Measurement:
    """Return the measurement of one inverter (t in s) from its reading.

    Beyond its range a sensor shows the end of its scale, so a plant that swings wildly still grants its ticks.
    """
    P, Q, V, f, P_set, V_set = [
        value if low <= value <= high else min(max(value, low), high)
        for value, (low, high) in zip(reading[:6], _SCALES, strict=True)
    ]
    return Measurement(
        sender=PLANT,
        epoch=epoch,
        seq=tick,
        t=t,
        to=name,
        P=P,
        Q=Q,
        V=V,
        f=f,
        P_set=P_set,
        V_set=V_set,
        grid_connected=reading.grid_connected,
        island=reading.island,
        roster=roster,
    )
