"""The plant's answer to "status". Pure."""

from __future__ import annotations

import msgspec

from gridpeers.wire.messages import Pacing, PlantEvent


class PlantStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The plant's answer to "status", as far as it is shown; see `gridpeers.plant.realtime.run_commands`."""

    phase: str
    """gathering, running or closing."""
    t: float
    """Run time (s)."""
    speed: float
    """Run time per wall time (s/s)."""
    pacing: Pacing
    agents: tuple[str, ...] = ()
    """Inverters whose agents take part."""
    absent: tuple[str, ...] = ()
    """Inverters whose agents do not."""
    events: tuple[PlantEvent, ...] = ()
    """The latest, oldest first."""
    impaired: tuple[str, ...] = ()
    """Agents whose link to or from the plant has an emulated fault."""
    switches: dict[str, bool] = {}
    """Position of each switch, by its name: whether it is closed."""
    loads: dict[str, tuple[float, float]] = {}
    """Real (W) and reactive power (var) at nominal voltage of each load that was set during the run."""

    @property
    def inverters(self) -> tuple[str, ...]:
        """All inverters of the plant."""
        return self.agents + self.absent
