"""Events of a run under way, packed: as objects an hour of people's changes has 2 MB, packed a tenth."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterator
from typing import Any

import msgspec

from gridpeers.wire.messages import PlantEvent

_encoder = msgspec.json.Encoder()
_decoder = msgspec.json.Decoder(dict[str, Any])


class PackedEvents:
    """Events in the order in which they were added.

    Examples
    --------
    >>> events = PackedEvents()
    >>> events.extend([PlantEvent(t=0.1, kind="trip", subject="inv1", text="inv1 trips")])
    >>> [event.text for event in events]
    ['inv1 trips']
    """

    def __init__(self) -> None:
        self._packer = zlib.compressobj()
        self._packed = bytearray()

    def extend(self, events: Collection[PlantEvent]) -> None:
        """Add events."""
        if events:
            self._packed += self._packer.compress(_encoder.encode_lines(events))

    def __iter__(self) -> Iterator[PlantEvent]:
        """Yield all events so far."""
        text = zlib.decompress(self._packed + self._packer.copy().flush())
        yield from (PlantEvent(**fields) for fields in _decoder.decode_lines(text))
