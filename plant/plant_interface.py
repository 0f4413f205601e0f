"""What the plant's side of a run needs of a plant: `plant.feeder.Plant` has it, and the small plants of the tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from wire.messages import PlantEvent


class ReadingLike(Protocol):
    """What the sensors of one inverter read; units as in `wire.messages.Measurement`."""

    @property
    def P(self) -> float: ...  # noqa: D102
    @property
    def Q(self) -> float: ...  # noqa: D102
    @property
    def V(self) -> float: ...  # noqa: D102
    @property
    def f(self) -> float: ...  # noqa: D102
    @property
    def P_set(self) -> float: ...  # noqa: D102
    @property
    def V_set(self) -> float: ...  # noqa: D102
    @property
    def grid_connected(self) -> bool: ...  # noqa: D102
    @property
    def island(self) -> str: ...  # noqa: D102


class PlantLike(Protocol):
    """What the lock-step needs of a plant; `plant.feeder.Plant` is one."""

    @property
    def inverters(self) -> tuple[str, ...]:
        """Names of the inverters."""
        ...

    def measure(self) -> Mapping[str, ReadingLike]:
        """Read all sensors now."""
        ...

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V)."""
        ...

    def connect(self, name: str, on: bool) -> None:
        """Put an inverter on the network or take it off; nothing happens if it is so already."""
        ...

    def advance(self) -> None:
        """Go one control period on; an island without solution is de-energised and told, and ends nothing."""
        ...

    def take_rows(self) -> tuple[tuple[float, ...], ...]:
        """Rows recorded since last taken."""
        ...

    def take_events(self) -> tuple[PlantEvent, ...]:
        """Events since last taken."""
        ...


class LivePlant(PlantLike, Protocol):
    """What wall-clock time needs of a plant on top: switches operated by hand."""

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        """Operate a switch ("open" or "close") at the next step; ValueError, naming what there is, if unknown.

        One that is to close synchronised and is not in step is a ValueError, too, that says how far off it is.

        Tells whether it stood so already.
        """
        ...
