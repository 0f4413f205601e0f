"""Entries of a journal from its bytes, which may be cut off, damaged, or from a later version."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import msgpack
import msgspec

from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.codec import CRC, sound
from gridpeers.wire.journal import AnyEntry, Entry
from gridpeers.wire.messages import LONGEST_MESSAGE, AnyMessage, Measurement, State

_HEAD = b"\xdd"  # Begins an array of msgpack, before the number of its values in four bytes

_decode_all = msgspec.msgpack.Decoder(list[AnyEntry]).decode
_decode_one = msgspec.msgpack.Decoder(AnyEntry).decode


def _raised(error: ValueError) -> None:
    raise error


def entries_of(data: bytes, note_damage: Callable[[ValueError], None] = _raised) -> Iterator[Entry]:
    """Yield the entries in the data of a `Journal`; those of unknown kinds, of a later version, are left out.

    `note_damage` takes the errors of damaged entries, which are left out too; by default they are raised.
    """
    if len(data) > LONGEST_MESSAGE:
        note_damage(ValueError(f"{len(data)} bytes, a part of a journal has at most {LONGEST_MESSAGE}"))
        return
    ends, broken = _ends(data)
    whole = _HEAD + (len(ends) - 1).to_bytes(4, "big") + data[: ends[-1]]
    try:
        yield from _decode_all(whole)
    except (msgspec.DecodeError, ValueError, RecursionError):  # one by one, which takes twenty times as long
        for begin, end in pairwise(ends):
            try:
                yield _decode_one(data[begin:end])
            except (msgspec.DecodeError, ValueError, RecursionError) as error:
                if not str(error).startswith("Invalid value"):  # else it is of a kind of a later version
                    note_damage(ValueError(f"an entry is none of ours: {error}"))
    if broken:
        note_damage(ValueError(broken))


def _ends(data: bytes) -> tuple[list[int], str]:
    """Return the places (bytes) between msgpack values, and why what follows the last one is none, or ""."""
    unpacker, ends = msgpack.Unpacker(max_buffer_size=LONGEST_MESSAGE), [0]
    unpacker.feed(data)
    try:
        while ends[-1] < len(data):
            unpacker.skip()
            ends.append(unpacker.tell())
    except (msgpack.UnpackException, ValueError) as error:
        why = "it ends within the entry" if isinstance(error, msgpack.OutOfData) else str(error) or "no msgpack"
        return ends, f"no msgpack at byte {ends[-1]}: {why}"
    return ends, ""


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
