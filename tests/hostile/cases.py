"""Every field of every message at, below and beyond its bounds, from the annotations: a new field is in at once."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeVar
from zlib import crc32

import msgspec
from msgspec import inspect, to_builtins

from gridpeers.wire.codec import CRC, RejectedError, decode
from gridpeers.wire.messages import MESSAGES, Message, Nameplate
from tests.golden.messages.message_values import WHOLE

_ORDINARY: dict[str, dict[str, Any]] = {
    "LinkReport": dict(final=False),
    "Measurement": dict(to="inv1", roster=("inv1", "inv2")),
    "State": dict(idle=False, quiet=False, fault=""),
    "Stop": dict(refused=False),
    "Telemetry": dict(rows=((0.0, 60.0, 5e4, 0.0, 277.0, 5e4, 277.0),), final=False, others=0),
}
BODIES = {
    type(of).__name__: to_builtins(of, builtin_types=(bytes,)) | _ORDINARY.get(type(of).__name__, {}) for of in WHOLE
}
"""A sound message of each type in the middle of a run, with all its fields."""

TEXTS = (
    "", "x", "inv1", "plant", "x" * 64, "x" * 65, "x" * 200, "x" * 201, "x" * 4000, "x" * 4001, "a b", "a,b", "a/b",
    "*", "a\n", "\x1b[2Jinv1", "inv1\x00", "\u202e1vni", "inv1\U000e0041", "inv1\r2026-01-01 ERROR all is lost",
    "ä", "\ud7ff\U0001f600",
)  # fmt: skip
"""Texts on both sides of any bound; which side, the annotation says."""


M = TypeVar("M", bound=Message)


class Case(NamedTuple):
    """One field with one value."""

    kind: type[Message]
    path: str
    """Of the field, e.g. "events.0.t"."""
    value: Any
    within: bool | None
    """Whether the annotation allows it; None if it may contradict another field."""
    payload: bytes


def sealed(body: bytes) -> bytes:
    return body + crc32(body).to_bytes(CRC, "little")


def sound(kind: type[Message], **header: Any) -> dict[str, Any]:
    """A message that can be decoded, as a dictionary."""
    return BODIES[kind.__name__] | dict(sender="inv2", epoch=1, seq=3, t=0.06) | header


def sound_message(kind: type[M], **fields: Any) -> M:
    return msgspec.convert(sound(kind, **fields), kind)


def packed(body: dict[str, Any]) -> bytes:
    return sealed(msgspec.msgpack.encode(body))


def cases(kind: type[Message], **header: Any) -> Iterator[Case]:
    """Every field of a message at, below and beyond its bounds; the header's fields are as given elsewhere."""
    body = sound(kind, **header)
    for path, type_, put in _leaves(inspect.type_info(kind), body):
        for value, within in _values(type_):
            yield Case(kind, path, value, within, packed(put(value)))
    yield Case(kind, "(more)", 1, False, packed({**body, "more": 1}))
    for name in [field.name for field in msgspec.structs.fields(kind) if field.required]:
        yield Case(kind, name, "(missing)", False, packed({key: value for key, value in body.items() if key != name}))


def all_cases(**header: Any) -> Iterator[Case]:
    for kind in MESSAGES:
        yield from cases(kind, **header)


def _leaves(type_: Any, body: Any) -> Iterator[tuple[str, Any, Any]]:
    """Path, type and a function that puts a value there, of each field and of what is inside of it."""
    for i, field in enumerate(type_.fields):
        key: Any = i if type_.array_like else field.encode_name
        yield from _inside(str(field.encode_name), field.type, body, key)


def _inside(path: str, type_: Any, holder: Any, key: Any) -> Iterator[tuple[str, Any, Any]]:
    def put(value: Any) -> Any:
        copy = list(holder) if isinstance(holder, list | tuple) else dict(holder)
        copy[key] = value
        return copy

    yield path, type_, put
    inner = next((part for part in _parts(type_) if isinstance(part, inspect.StructType)), None)
    if isinstance(type_, inspect.VarTupleType):
        inside = _inside("0", type_.item_type, list(holder[key] or [0.0]), 0)
    elif isinstance(type_, inspect.TupleType):
        inside = (leaf for i, item in enumerate(type_.item_types) for leaf in _inside(str(i), item, holder[key], i))
    elif isinstance(type_, inspect.DictType):
        name = next(iter(holder[key]))
        inside = _inside(name, type_.value_type, holder[key], name)
    elif inner is not None:
        inside = _leaves(inner, holder[key])
    else:
        return
    for tail, leaf, put_inside in inside:
        yield f"{path}.{tail}", leaf, lambda value, put_inside=put_inside: put(put_inside(value))


def _parts(type_: Any) -> tuple[Any, ...]:
    return tuple(map(plain, type_.types if isinstance(type_, inspect.UnionType) else (type_,)))


def plain(type_: Any) -> Any:
    """A type with the pattern that its message checks by itself, if it has one."""
    if not isinstance(type_, inspect.Metadata):
        return type_
    assert type_.extra is not None
    return msgspec.structs.replace(type_.type, pattern=type_.extra["pattern"])


def _values(type_: Any) -> Iterator[tuple[Any, bool | None]]:
    """Values on both sides of what a type allows, and whether it does; None where it depends on other fields."""
    types = _parts(type_)
    none = any(isinstance(part, inspect.NoneType | inspect.AnyType) for part in types)
    yield None, none
    for part in types:
        match part:
            case inspect.FloatType() | inspect.IntType():
                yield from _numbers(part)
            case inspect.StrType():
                for text in TEXTS:
                    fits = part.pattern is None or re.search(part.pattern, text) is not None
                    yield text, fits and (part.max_length is None or len(text) <= part.max_length)
                yield 7, False
            case inspect.BytesType():
                yield b"\xc1" * 100, True
                yield from [(b"\x00" * (part.max_length + 1), False)] if part.max_length is not None else []
            case inspect.BoolType():
                yield from ((True, None), (False, None), (2, False))
            case inspect.LiteralType():
                yield from ((value, True) for value in part.values)
                yield "nothing of the kind", False
            case inspect.VarTupleType():
                yield (), None
                assert part.max_length is not None or isinstance(part.item_type, inspect.FloatType)
                yield [None] * ((part.max_length or 10_000) + 1), False
                yield ("inv1", "inv1"), None
                yield {"0": "inv1"}, False
            case inspect.AnyType():
                yield from ((1.0, True), ("x", True), ({"a b": [None, True]}, True), (math.nan, False), (b"x", False))
                yield from (("\x1b[2J", False), ("x" * 4001, False), ({"x": {"\x1b": 1}}, False), ({1: 2}, False))
                yield from ((_nested(6), True), (_nested(7), False))
            case inspect.DictType(value_type=inspect.AnyType()):
                yield from (({}, True), ({"\x1b": 0.1}, False), (7, False))
                yield {f"x{i}": 0.1 for i in range(part.max_length + 1)}, False
            case inspect.DictType():
                yield from (({}, True), ({"a b": 0.1}, False), ({"\x1b": 0.1}, False), ({"x": "1"}, False), (7, False))
                yield {f"x{i}": 0.1 for i in range(part.max_length + 1)}, False
            case inspect.StructType() | inspect.TupleType():
                yield from ((7, False), ([], False))


def _nested(depth: int) -> Any:
    value: Any = 1
    for _ in range(depth):
        value = [value]
    return value


def _numbers(part: Any) -> Iterator[tuple[Any, bool | None]]:
    whole = isinstance(part, inspect.IntType)
    if part.ge is part.gt is part.le is part.lt is None:  # the recorder's rows take what the plant says
        yield from ((math.nan, None), (1e300, None), ("1", False))
        return
    assert part.le is not None
    low, high = part.ge if part.ge is not None else part.gt, part.le
    beyond = [high + 1, 2**63 - 1, 2**63, 2**64 - 1, low - 1, -(2**63)] if whole else [1e300, -1e300, 2**63, 2**64 - 1]
    if not whole:
        beyond += [math.nextafter(high, math.inf), math.nextafter(low, -math.inf), math.nan, math.inf, -math.inf]
        beyond += [] if part.ge is not None else [low]
    at = [low if part.ge is not None else math.nextafter(low, math.inf), high]
    yield from ((value, True) for value in at)
    yield from ((value, False) for value in [*beyond, "1", [], b"\x00" * 8])


Truth = Mapping[str, tuple[str, tuple[type[Message], ...]]]
"""Of each key who speaks there, empty for anybody, and with which messages."""


def hostile(keys: Truth, epochs: Mapping[str, int], rng: random.Random) -> Iterator[tuple[str, bytes]]:
    """Keys and bytes in any order, some twice: nothing that a key's true sender might say in its epoch."""
    headers: list[dict[str, Any]] = [
        {"sender": sender, "epoch": epoch + life, "seq": seq}
        for sender, epoch in epochs.items()
        for life, seq in ((0, 3), (-1, 10**6), (1, 2**53 - 1))
    ]
    every = [*keys]
    found = [(key, case.payload) for header in headers for case in all_cases(**header) for key in rng.sample(every, 2)]
    found += [
        (key, packed(sound(kind, sender=sender, epoch=epoch, seq=seq, t=t)))
        for key in every
        for kind in MESSAGES
        for sender, epoch in epochs.items()
        for seq, t in ((0, 0.0), (10**9, 1e9))
    ]
    rng.shuffle(found)
    for key, payload in found:
        if not _is_true(key, payload, keys, epochs):
            yield from [(key, payload)] * rng.choice((1, 1, 2))


def _is_true(key: str, payload: bytes, keys: Truth, epochs: Mapping[str, int]) -> bool:
    """Whether it cannot be told from what the true sender might say. A nameplate can, as it is learnt once."""
    sender, types = keys[key]
    try:
        message = decode(payload)
    except RejectedError:
        return False
    if not isinstance(message, types) or isinstance(message, Nameplate):
        return False
    return not sender or (message.sender == sender and message.epoch == epochs[sender])
