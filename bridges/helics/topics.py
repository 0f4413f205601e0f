"""Topics between a plant and controllers in a HELICS federation: names, types, units (docs/helics.md). Pure.

A plant publishes at every record time t what its sensors show at t. A controller hears it and publishes set-points
`ACT` later: by then all values of t are there, and the plant takes the set-points for what follows t.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal, NamedTuple

ACT = 1e-6
"""Time (s) by which a controller follows the plant: shorter than any step of a plant, and a thousand times HELICS's
own resolution."""

Value = float | bool | str  # value of a topic


class Topic(NamedTuple):
    """One HELICS value."""

    key: str
    type: Literal["double", "boolean", "string"]
    unit: str  # unit as HELICS knows it: it converts from a publisher's other one. "" for none.


SENSORS = (  # measurements that a plant publishes of every inverter, in the order of a recorded row
    Topic("f", "double", "Hz"),
    Topic("P", "double", "W"),
    Topic("Q", "double", "var"),
    Topic("V", "double", "V"),
)

HELD = (Topic("P_set_held", "double", "W"), Topic("V_set_held", "double", "V"))
"""Set-points that an inverter follows, after its bounds; in the order of a recorded row, behind the sensors."""

WHERE = (Topic("grid_connected", "boolean", ""), Topic("island", "string", ""))
"""An inverter's island: whether the substation feeds it, and its name."""

SET_POINTS = (Topic("P_set", "double", "W"), Topic("V_set", "double", "V"))
"""Set-points that a controller publishes for every inverter."""


def topics(prefix: str, inverters: Iterable[str], *groups: Iterable[Topic]) -> list[Topic]:
    """Return the topics of some groups for each of some inverters.

    >>> topics("grid", ["inv1"], SET_POINTS)[0]
    Topic(key='grid/inv1/P_set', type='double', unit='W')
    """
    return [
        topic._replace(key=f"{prefix}/{inverter}/{topic.key}")
        for inverter in inverters
        for group in groups
        for topic in group
    ]


def events(prefix: str) -> Topic:
    """Return the topic of a plant's events: a JSON list with t, kind, subject, text of each."""
    return Topic(f"{prefix}/events", "string", "")


def number(value: Value) -> float:
    """Return a value as a number; not-a-number for HELICS's mark of a double that is none, -1e49."""
    return float(value) if abs(float(value)) < 1e40 else math.nan
