"""Entries of a journal from its bytes, which may be cut off, damaged, or from a later version."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgpack
import msgspec

from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.codec import CRC, sound
from gridpeers.wire.journal import ENTRIES, AnyEntry, Entry
from gridpeers.wire.messages import LONGEST_MESSAGE, AnyMessage, Measurement, State

_HEAD = b"\xdd"  # Begins an array of msgpack, before the number of its values in four bytes

_LENGTHS = {kind.__struct_config__.tag: 1 + len(kind.__struct_fields__) for kind in ENTRIES}
"""Number of values of an entry of each kind, with the kind itself."""

_decoder = msgspec.msgpack.Decoder(list[AnyEntry])


def entries_of(data: bytes, note_damage: Callable[[ValueError], None] | None = None) -> Iterator[Entry]:
    """Yield the entries in the data of a `Journal`; those of unknown kinds, of a later version, are left out.

    With `note_damage`, which takes their errors, damaged entries are left out too.

    Raise ValueError where the bytes end within an entry, or make none.
    """
    try:
        yield from _whole_entries(data)
    except (msgpack.UnpackException, msgspec.DecodeError, ValueError, RecursionError):
        for raw in _raw_entries(data, note_damage):
            try:
                entry = _entry_of(raw)
            except ValueError as error:
                if note_damage is None:
                    raise
                note_damage(error)
            else:
                if entry is not None:
                    yield entry


def _whole_entries(data: bytes) -> Sequence[Entry]:
    """Return all entries at once, which takes a twentieth of the time; raise an error if any is damaged or unknown."""
    unpacker, count = msgpack.Unpacker(max_buffer_size=LONGEST_MESSAGE), 0
    unpacker.feed(data)
    while unpacker.tell() < len(data):
        unpacker.skip()
        count += 1
    return _decoder.decode(_HEAD + count.to_bytes(4, "big") + data)


def _raw_entries(data: bytes, note_damage: Callable[[ValueError], None] | None) -> Iterator[Any]:
    """Yield the msgpack values in the data of a journal, whatever they are; `_entry_of` checks them."""
    most, end = LONGEST_MESSAGE, 0
    unpacker = msgpack.Unpacker(max_buffer_size=most, max_array_len=most, max_map_len=most, strict_map_key=False)
    try:
        if len(data) > most:
            raise ValueError(f"{len(data)} bytes, a part of a journal has at most {most}")
        unpacker.feed(data)
        while end < len(data):
            raw = unpacker.unpack()
            end = unpacker.tell()
            yield raw
    except (msgpack.UnpackException, ValueError, TypeError, RecursionError) as error:  # of type: a list as a key
        why = f"it ends within the entry from byte {end} on" if isinstance(error, msgpack.OutOfData) else str(error)
        damage = ValueError(f"no msgpack at byte {unpacker.tell()}: {why or type(error).__name__}")
        if note_damage is None:
            raise damage from None
        note_damage(damage)


def _entry_of(raw: Any) -> Entry | None:
    """Return an entry, without what a later version added at its end; None if it is of a kind of a later version.

    Raise ValueError if it is none of ours.
    """
    if isinstance(raw, list) and raw and isinstance(raw[0], str) and raw[0] in _LENGTHS:
        raw = raw[: _LENGTHS[raw[0]]]
    try:
        entry: Entry = msgspec.convert(raw, AnyEntry)
    except msgspec.ValidationError as error:
        if str(error).startswith("Invalid value"):
            return None
        raise ValueError(f"an entry is none of ours: {error}") from None
    return entry


def message_of(
    raw: bytes | Sequence[Any], kind: type[Measurement] | type[State], info: RecordInfo
) -> AnyMessage | None:
    """Return a message of an `Exchange`: from its bytes, or from its values in the order of the fields.

    None if it cannot be read: it is damaged, or has a value beyond its bounds.
    """
    if isinstance(raw, bytes):
        return sound(raw)
    fields = info.fields.get(kind.__name__, ())
    if not isinstance(raw, list | tuple) or len(raw) != len(fields):
        return None
    try:
        return msgspec.convert(dict(zip(fields, raw, strict=True)) | {"type": kind.__name__}, kind)
    except msgspec.ValidationError:
        return None


def values_of(payload: bytes) -> dict[str, Any]:
    """Return the values in a payload, also in one that no receiver would take; empty if it is no msgpack map.

    It reads messages of later versions and of other people's agents, and those that a link has corrupted.
    """
    try:
        values = msgpack.unpackb(payload[:-CRC], strict_map_key=False)
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError):  # of type: a list as a key
        return {}
    return {str(name): value for name, value in values.items()} if isinstance(values, dict) else {}
