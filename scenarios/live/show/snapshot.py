"""A run at one moment, for every view."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from gridpeers.wire.messages import PlantEvent

OLD = 0.2
"""An age (s) from which on it is shown in colour: ten control periods of 20 ms, half of what is still used."""

V_LOW, V_HIGH = 0.95, 1.05
"""Terminal voltages (pu) beyond which one is shown as off: range A of ANSI C84.1."""


@dataclass(frozen=True, kw_only=True)
class InverterStatus:
    """One inverter and its agent at one moment; None stands for an unknown value."""

    name: str
    island: str = ""
    """Name of its island: "grid", or the first inverter in it; "" if nobody has said."""
    f: float | None = None
    """Hz."""
    P: float | None = None
    """kW."""
    P_set: float | None = None
    """kW."""
    P_share: float | None = None
    """P by its rating (pu)."""
    Q: float | None = None
    """kvar."""
    V: float | None = None
    """pu of its nominal voltage."""
    V_set: float | None = None
    """pu of its nominal voltage."""
    ages: dict[str, float] = field(default_factory=dict)
    """Age (s) of the latest state of each neighbour that it uses."""
    hears: int | None = None
    """Neighbours that it uses; None if that is not known."""
    late: bool = False
    """Whether the latest state of one of them is `OLD`."""
    off_voltage: bool = False
    """Whether V is beyond `V_LOW` to `V_HIGH`."""
    received: int | None = None
    """Messages that came in."""
    sent: int | None = None
    """Messages that went out."""
    lost: int | None = None
    """Messages that were sent to it and never came."""
    impaired: tuple[str, ...] = ()
    """Senders whose links to it have an emulated fault."""
    note: str = ""
    """A note for the reader: "no agent", "not heard here; the plant hears it", "waits for ...", "silent for 3 s"."""


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """A run at one moment."""

    run: str
    t: float | None = None
    """Run time (s)."""
    pace: str = ""
    """The plant's pace in a few words."""
    speed: float = 1.0
    """Run time per wall time (s/s)."""
    impaired: tuple[str, ...] = ()
    """Agents whose link to or from the plant has an emulated fault."""
    inverters: tuple[InverterStatus, ...] = ()
    """All inverters, in their order."""
    events: tuple[str, ...] = ()
    """Events, a line each, the latest last."""


def line_of(event: PlantEvent) -> str:
    """Return an event as a line; its time comes first and only there.

    Examples
    --------
    >>> line_of(PlantEvent(t=1.5, kind="roster", subject="inv2", text="inv2 joined, at t = 1.5 s"))
    '    1.50 s  inv2 joined'
    >>> line_of(PlantEvent(t=1.5, kind="roster", subject="inv2", text="inv2 joined, at t = 1.50 s"))
    '    1.50 s  inv2 joined'
    """
    return f"{event.t:8.2f} s  {re.sub(r', at t = [0-9.e+]+ s$', '', event.text)}"
