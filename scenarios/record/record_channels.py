"""The channels of a record: their topics, encodings, and schemas made from the code."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal, NamedTuple

import msgspec

from gridpeers.wire.journal import ENTRIES
from gridpeers.wire.messages import AnyMessage, Journal, LinkReport, LinkRequest, Telemetry

Topic = Literal["telemetry", "journal", "link_reports", "link_requests", "physics", "events"]
"""Topics of a record."""


class RecordChannel(NamedTuple):
    """One channel of a record."""

    topic: Topic
    """Its name."""
    encoding: Literal["msgpack", "json"]
    """Encoding of its messages: those of the wire are msgpack with their CRC-32, those for viewers JSON."""
    schema_name: str
    """Name of its schema."""
    schema: bytes
    """JSON schema of its messages."""


TOPICS: dict[type[Telemetry] | type[Journal] | type[LinkReport] | type[LinkRequest], Topic] = {
    Telemetry: "telemetry",
    Journal: "journal",
    LinkReport: "link_reports",
    LinkRequest: "link_requests",
}
"""Topic of each message that the plant publishes for recorders. Their payloads are in the record as they were sent."""

_EVENTS = {
    "type": "object",
    "title": "foxglove.Log",
    "description": "An event of the plant, of the roster or of links; a row of events.csv.",
    "properties": {
        "timestamp": {
            "type": "object",
            "description": "Run time.",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "level": {"type": "integer", "description": "2: information, 3: warning."},
        "message": {"type": "string", "description": "One sentence."},
        "name": {"type": "string", "description": "Kind of the event."},
        "file": {"type": "string", "description": "The switch, island or agent concerned."},
        "line": {"type": "integer"},
    },
}


@lru_cache(maxsize=4)
def channels(inverters: tuple[str, ...], quantities: tuple[str, ...]) -> tuple[RecordChannel, ...]:
    """Return the channels of a record.

    Parameters
    ----------
    inverters : tuple[str, ...]
        Names of the inverters, the columns of the physics.
    quantities : tuple[str, ...]
        Quantities of each, with their units.
    """
    numbers = {"type": "object", "properties": {name: {"type": ["number", "null"]} for name in quantities}}
    physics = {
        "type": "object",
        "title": "gridpeers.Physics",
        "description": "Terminal quantities of every inverter; null stands for a number that is not finite.",
        "properties": {"t_s": {"type": "number"}} | dict.fromkeys(inverters, numbers),
    }
    wire = tuple(
        RecordChannel(topic, "msgpack", f"gridpeers.{kind.__name__}", _json(_schema(kind)))
        for kind, topic in TOPICS.items()
    )
    return (
        *wire,
        RecordChannel("physics", "json", "gridpeers.Physics", _json(physics)),
        RecordChannel("events", "json", "foxglove.Log", _json(_EVENTS)),
    )


_json = msgspec.json.encode


def _schema(kind: type[AnyMessage]) -> dict[str, Any]:
    """Return the JSON schema of a message; that of a journal has the schemas of its entries beside it."""
    schema = msgspec.json.schema(kind)
    if kind is Journal:
        entries = [msgspec.json.schema(entry) for entry in ENTRIES]
        schema["$defs"] |= {name: definition for entry in entries for name, definition in entry["$defs"].items()}
        schema["description"] = (
            "A part of a node's journal: msgpack arrays, one after the other, each with the kind of the entry first; "
            "their schemas are among the definitions."
        )
    return schema
