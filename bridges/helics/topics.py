"""Topics between a plant and controllers in a HELICS federation: names, types, units (docs/helics.md). Pure.

A plant publishes at every record time t what its sensors show at t. A controller hears it and publishes set-points
`ACT` later: by then all values of t are there, and the plant takes the set-points for what follows t.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

ACT = 1e-6
"""Time (s) by which a controller follows the plant: shorter than any step of a plant, and a thousand times HELICS's
own resolution."""

Value = float | bool | str
"""Value of a topic."""


class Topic(NamedTuple):
    """One HELICS value."""

    key: str
    type: Literal["double", "boolean", "string"]
    unit: str
    """Unit as HELICS knows it: it converts from a publisher's other one. "" for none."""


SENSORS = (("f", "Hz"), ("P", "W"), ("Q", "var"), ("V", "V"))
"""Measurements that a plant publishes of every inverter, in the order of a recorded row."""

HELD = (("P_set_held", "W"), ("V_set_held", "V"))
"""Set-points that an inverter follows, after its bounds; in the order of a recorded row, behind the sensors."""

SET_POINTS = (("P_set", "W"), ("V_set", "V"))
"""Set-points that a controller publishes for every inverter."""


def sensors(prefix: str, inverter: str) -> list[Topic]:
    """Return the topics that a controller needs of an inverter."""
    return [Topic(f"{prefix}/{inverter}/{name}", "double", unit) for name, unit in SENSORS]


def held(prefix: str, inverter: str) -> list[Topic]:
    """Return the topics of the set-points that an inverter follows."""
    return [Topic(f"{prefix}/{inverter}/{name}", "double", unit) for name, unit in HELD]


def where(prefix: str, inverter: str) -> list[Topic]:
    """Return the topics of an inverter's island: whether the substation feeds it, and its name."""
    return [
        Topic(f"{prefix}/{inverter}/grid_connected", "boolean", ""),
        Topic(f"{prefix}/{inverter}/island", "string", ""),
    ]


def set_points(prefix: str, inverter: str) -> list[Topic]:
    """Return the topics that a controller publishes for an inverter."""
    return [Topic(f"{prefix}/{inverter}/{name}", "double", unit) for name, unit in SET_POINTS]


def events(prefix: str) -> Topic:
    """Return the topic of a plant's events: a JSON list with t, kind, subject, text of each."""
    return Topic(f"{prefix}/events", "string", "")


def number(value: Value) -> float:
    """Return a value as a number; not-a-number for HELICS's mark of a double that is none, -1e49.

    Examples
    --------
    >>> number(60.0), number(-1e49)
    (60.0, nan)
    """
    return float(value) if abs(float(value)) < 1e40 else math.nan
