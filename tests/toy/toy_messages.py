"""Messages to and from the agents of the toy, tick by tick; whatever a test is about, it changes."""

from __future__ import annotations

from typing import Any

from gridpeers.wire.messages import Measurement, State

T_C = 0.02


def measurement(k: int = 0, **changes: Any) -> Measurement:
    """Return what the plant measures at inv1: half a load at nominal frequency and voltage, in an island."""
    values: dict[str, Any] = dict(
        sender="plant", epoch=1, seq=k, t=round(k * T_C, 9), to="inv1", P=50e3, Q=0.0, V=277.0, f=60.0, P_set=50e3,
        V_set=277.0, grid_connected=False, island="inv1", roster=(),
    )  # fmt: skip
    return Measurement(**values | changes)


def state(sender: str, k: int = 0, **changes: Any) -> State:
    values: dict[str, Any] = dict(sender=sender, epoch=1, seq=k, t=round(k * T_C, 9), P_set=80e3, V_set=277.0, Q=10e3)
    return State(**values | changes)
