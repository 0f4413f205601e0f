"""Entries of a journal from its bytes, which may be cut off, damaged, or from a later version."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgpack
import msgspec

from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.bounds import LONGEST_MESSAGE
from gridpeers.wire.codec import CRC, sound
from gridpeers.wire.journal import ENTRIES, AnyEntry, Entry, Exchange
from gridpeers.wire.messages import AnyMessage, Measurement, State

_HEAD = b"\xdd"  # Begins an array of msgpack, before the number of its values in four bytes

_LENGTHS = {kind.__struct_config__.tag: 1 + len(kind.__struct_fields__) for kind in ENTRIES}
"""Number of values of an entry of each kind, with the kind itself."""

_END = object()

_decoder = msgspec.msgpack.Decoder(list[AnyEntry])


def whole_entries(data: bytes) -> Sequence[Entry] | None:
    """Return all entries in the data of a `Journal` at once; None if any is damaged, unknown, or longer than ours.

    It takes a twentieth of the time of `raw_entries` and `entry_of`, which say what is wrong and read the rest.
    """
    unpacker, count = msgpack.Unpacker(max_buffer_size=LONGEST_MESSAGE), 0
    try:
        unpacker.feed(data)
        while unpacker.tell() < len(data):
            unpacker.skip()
            count += 1
        entries = _decoder.decode(_HEAD + count.to_bytes(4, "big") + data)
    except (msgpack.UnpackException, msgspec.DecodeError, ValueError, RecursionError):
        return None
    return entries


def entries_of(data: bytes, note_damage: Callable[[ValueError], None] | None = None) -> Iterator[Entry]:
    """Yield the entries in the data of a `Journal`; those of unknown kinds are left out.

    With `note_damage`, which takes their errors, damaged entries are left out too.

    Raise ValueError where the bytes end within an entry, or make none.
    """
    if (entries := whole_entries(data)) is not None:
        yield from entries
        return
    values = raw_entries(data)
    while True:
        try:
            raw = next(values, _END)
            entry = None if raw is _END else entry_of(raw)
        except ValueError as error:  # if the bytes end here, `values` does too
            if note_damage is None:
                raise
            note_damage(error)
            continue
        if raw is _END:
            return
        if entry is not None:
            yield entry


def raw_entries(data: bytes) -> Iterator[Any]:
    """Yield what follows each other in the data of a `Journal`: any msgpack values, which `entry_of` checks.

    Raise ValueError where the bytes end within a value, or make none.
    """
    most = LONGEST_MESSAGE
    unpacker = msgpack.Unpacker(max_buffer_size=most, max_array_len=most, max_map_len=most, strict_map_key=False)
    if len(data) > most:
        raise ValueError(f"{len(data)} bytes, a part of a journal has at most {most}")
    unpacker.feed(data)
    end = 0
    while True:
        try:
            raw = unpacker.unpack()
        except msgpack.OutOfData:
            if end != len(data):
                raise ValueError(f"it ends at byte {len(data)}, within the entry from byte {end} on") from None
            return
        except (msgpack.UnpackException, ValueError, TypeError, RecursionError) as error:  # of type: a list as a key
            raise ValueError(f"no msgpack at byte {unpacker.tell()}: {error or type(error).__name__}") from None
        end = unpacker.tell()
        yield raw


def entry_of(raw: Any) -> Entry | None:
    """Return the entry that a value of `raw_entries` makes; None if it is of a kind that a later version has.

    Values that a later version may have added at its end are left out. Raise ValueError if it is none of ours, or has
    another one at its end: its length is damaged, and it took in what followed.
    """
    match raw:
        case ["exchange", int(tick), list(measurements), list(states)]:  # msgspec would copy each value in it
            return Exchange(tick, measurements, states)
    if isinstance(raw, list) and raw and isinstance(raw[0], str) and raw[0] in _LENGTHS:
        length = _LENGTHS[raw[0]]
        if any(isinstance(value, list) and value and value[0] in tuple(_LENGTHS) for value in raw[length:]):
            raise ValueError(f'an entry "{raw[0]}" has another one at its end, as its length is damaged')
        raw = raw[:length]
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
    """Return what a payload says, whether a receiver would take it or not; empty if it is no msgpack map.

    It reads messages of later versions and of other people's agents, and those that a link has corrupted.
    """
    try:
        values = msgpack.unpackb(payload[:-CRC], strict_map_key=False)
    except (ValueError, TypeError, msgpack.UnpackException, RecursionError):  # of type: a list as a key
        return {}
    return {str(name): value for name, value in values.items()} if isinstance(values, dict) else {}
