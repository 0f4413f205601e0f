"""A run at one moment, for every view."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Line:
    """One inverter and its agent. What is not known (yet) is None."""

    name: str
    kind: str = ""
    """GFM or GFL."""
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
    """Its neighbours, and how old (s) what it heard of each is."""
    received: int | None = None
    """Messages that came in."""
    sent: int | None = None
    """Messages that went out."""
    lost: int | None = None
    """Messages that were sent to it and never came."""
    rejected: int | None = None
    """Messages that came in and could not be used."""
    impaired: tuple[str, ...] = ()
    """Senders between whom and it an emulated fault holds."""
    note: str = ""
    """What a person should know: "no agent", "waits for ...", "silent for 3 s"."""


@dataclass(frozen=True, kw_only=True)
class Snapshot:
    """A run at one moment."""

    run: str
    t: float | None = None
    """Run time (s)."""
    pace: str = ""
    """How well the plant keeps real time, in a few words."""
    impaired: tuple[str, ...] = ()
    """Agents between whom and the plant an emulated fault holds."""
    lines: tuple[Line, ...] = ()
    """In the order of the inverters."""
    events: tuple[str, ...] = ()
    """What happened, a line each, the latest last."""
