"""Physics and events as JSON, which viewers of MCAP files plot and list by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import msgspec

from gridpeers.wire.messages import PlantEvent

_encode = msgspec.json.encode

NANO = 1_000_000_000


def nanoseconds(t: float) -> int:
    """Return a run time (s) as time in a record: whole nanoseconds since t = 0.

    Examples
    --------
    >>> nanoseconds(4.3)
    4300000000
    """
    return round(t * NANO)


class PhysicsTemplate:
    r"""Rows of telemetry as JSON objects.

    Parameters
    ----------
    inverters : Sequence[str]
        Names, the order of the columns.
    quantities : Sequence[str]
        Quantities of each inverter, with their units.

    Examples
    --------
    >>> PhysicsTemplate(["inv1"], ["f_Hz", "P_W"]).of(b"0.02,60.0,nan\n", (0.02, 60.0, float("nan")))
    b'{"t_s":0.02,"inv1":{"f_Hz":60.0,"P_W":null}}'
    """

    def __init__(self, inverters: Sequence[str], quantities: Sequence[str]) -> None:
        values = ",".join(f'"{quantity}":%b' for quantity in quantities)
        objects = "".join(f',"{name}":{{{values}}}' for name in inverters)
        self._template = f'{{"t_s":%b{objects}}}'.encode()

    def of(self, line: bytes, row: Sequence[float]) -> bytes:
        """Return a row from its line of history.csv, whose texts of finite numbers are those of JSON."""
        texts = line[:-1].split(b",")
        if b"n" in line:
            texts = [text if isfinite(number) else b"null" for text, number in zip(texts, row, strict=True)]
        return self._template % tuple(texts)


def event_json(event: PlantEvent) -> bytes:
    """Return an event as a `foxglove.Log`, which viewers list."""
    at = nanoseconds(event.t)
    log = {
        "timestamp": {"sec": at // NANO, "nsec": at % NANO},
        "level": 3 if event.kind == "warning" else 2,
        "message": event.text,
        "name": event.kind,
        "file": event.subject,
        "line": 0,
    }
    return _encode(log)
