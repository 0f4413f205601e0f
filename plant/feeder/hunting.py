"""The event of a grid-following inverter that has no rest at the start, because its volt-var characteristic jumps."""

from __future__ import annotations

from gridpeers.wire.messages import PlantEvent


def hunting_event(name: str) -> PlantEvent:
    """Return the event of an inverter that starts on the edge of its dead band."""
    text = (
        f"{name} has no rest at t = 0: without vars its voltage is beyond its dead band, with those of its droop it is "
        "within, so Q hunts between both; choose another db_UV_pu, db_OV_pu or V_set0_pu to avoid it"
    )
    return PlantEvent(t=0.0, kind="warning", subject=name, text=text)
