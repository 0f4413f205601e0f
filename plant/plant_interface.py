"""The interface of a plant to its node: that of `gridpeers.plant.feeder.Plant`, and of other simulators' plants."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from gridpeers.wire.messages import LoadSetting, PlantEvent


class Reading(NamedTuple):
    """Sensor readings of one inverter."""

    P: float  # real power out (W)
    Q: float  # reactive power out (var)
    V: float  # mean terminal voltage (V, line-to-neutral)
    f: float  # frequency (Hz)
    P_set: float  # set-point held (W)
    V_set: float  # set-point held (V)
    grid_connected: bool  # whether the substation feeds its island
    island: str
    """"grid", or the name of the first inverter in its island; `OFF` for one that is off the network or idle."""


class PlantLike(Protocol):
    """The part of a plant that the lock-step uses; `gridpeers.plant.feeder.Plant` has it."""

    @property
    def inverters(self) -> tuple[str, ...]: ...

    def measure(self) -> Mapping[str, Reading]: ...

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V)."""

    def connect(self, name: str, on: bool) -> None:
        """Connect or disconnect an inverter; do nothing if it is in that state already."""

    def advance(self) -> None:
        """Advance one control period; de-energise an island without solution, which is an event and ends nothing.

        Raise RuntimeError if the plant cannot go on: the run breaks, and reports the message.
        """

    def take_rows(self) -> tuple[tuple[float, ...], ...]:
        """Take out the rows recorded since the last call, every `PlantConfig.record_step` from t = 0 on.

        Each is t (s), then for each inverter f (Hz), P (W), Q (var), V (V), P_set (W), V_set (V): history.csv.
        """

    def take_events(self) -> tuple[PlantEvent, ...]: ...

    def close(self) -> None:
        """End what belongs to the plant outside of this process, after a good end and after a bad one."""


class LivePlant(PlantLike, Protocol):
    """The further part that real time uses, in which our plant alone runs: switches and loads that people set."""

    @property
    def switches(self) -> Mapping[str, bool]:
        """Map the name of each switch to True if it is closed."""

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        """Operate a switch ("open" or "close") at the next step; return whether it was in that state already.

        ValueError if there is no such switch, or it should close synchronised and its sides are not in step.
        """

    @property
    def loads(self) -> Mapping[str, complex]:
        """Power at nominal voltage (VA) of each load that has another one than in the feeder's tables now."""

    def set_load(self, name: str, setting: LoadSetting) -> str:
        """Have a load take another power at the next step; return it in words. ValueError if it cannot."""


class RecordedPlant:
    """The rows and events of a plant, kept until they are taken: `take_rows` and `take_events` of `PlantLike`."""

    _rows: list[tuple[float, ...]]
    _events: list[PlantEvent]

    def take_rows(self) -> tuple[tuple[float, ...], ...]:
        rows, self._rows = tuple(self._rows), []
        return rows

    def take_events(self) -> tuple[PlantEvent, ...]:
        events, self._events = tuple(self._events), []
        return events
