"""Messages that nobody should send: random bytes, and sound messages that were changed, by a seed."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec

from gridpeers.wire.codec import CRC
from gridpeers.wire.messages import MESSAGES
from tests.hostile.cases import cases, packed, sealed, sound

EPOCH = 7  # Epoch in which everybody really lives

SENDERS = ("plant", "inv1", "inv2", "inv3", "inv9", "visitor")

NUMBERS = (
    0, 1, -1, 2, 7, 50, 127, 128, 255, 2**16, 2**31, 2**32, 2**53 - 1, 2**53, 2**63 - 1, 2**64 - 1, -(2**63), 0.0, -0.0,
    1e-300, 0.06, 60.0, 1e9, 1e12, 1e300, -1e300, 5e-324, math.inf, -math.inf, math.nan,
)  # fmt: skip

TEXTS = (
    "", "x", "inv1", "plant", "off", "grid", "*", "a/b", "x" * 64, "x" * 65, "x" * 4001, "\x1b[2J", "\n", "\x00",
    "\u202e", "\U000e0041", "State", "Stop", "0", "9" * 30, "sw1", "load1", "status",
)  # fmt: skip

LENGTHS = (
    b"\xdd\xff\xff\xff\xff",
    b"\xdf\xff\xff\xff\xff",
    b"\xdb\xff\xff\xff\xff",
    b"\xc6\xff\xff\xff\xff",
    b"\xdc\xff\xff",
)
"""Heads of a list, a map, a text and bytes that say that four billion values follow."""


class Made(NamedTuple):
    """A message and how it was made."""

    way: str
    payload: bytes


def _corpus() -> list[bytes]:
    found = [packed(sound(kind, sender=name, epoch=EPOCH)) for kind in MESSAGES for name in SENDERS[:4]]
    return found + [case.payload for kind in MESSAGES for case in cases(kind, epoch=EPOCH) if len(case.payload) < 2_000]


class Mutation:
    """Makes messages from a seed, the same each time."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self._corpus = _corpus()
        ways: dict[str, tuple[int, Callable[[], bytes]]] = {
            "random bytes": (1, self._random),
            "random bytes, sealed": (1, lambda: sealed(self._random())),
            "bits flipped": (2, self._flipped),
            "bits flipped, sealed": (4, lambda: sealed(self._flipped()[:-CRC])),
            "cut, joined": (2, self._cut),
            "cut, joined, sealed": (2, lambda: sealed(self._cut())),
            "a field changed": (8, self._changed),
            "a length changed": (1, self._lengthened),
            "nested": (1, self._nested),
            "sound, of anybody": (4, self._of_anybody),
        }
        self._ways = list(ways)
        self._weights = [weight for weight, _ in ways.values()]
        self._make = {way: make for way, (_, make) in ways.items()}

    def make(self) -> Made:
        (way,) = self.rng.choices(self._ways, self._weights)
        return Made(way, self._make[way]())

    def _random(self) -> bytes:
        return self.rng.randbytes(int(self.rng.expovariate(1 / 80)))

    def _any(self) -> bytes:
        return self.rng.choice(self._corpus)

    def _flipped(self) -> bytes:
        data = bytearray(self._any())
        for _ in range(self.rng.choice((1, 1, 1, 2, 3, 20))):
            data[self.rng.randrange(len(data))] ^= 1 << self.rng.randrange(8)
        return bytes(data)

    def _cut(self) -> bytes:
        first, second = self._any()[:-CRC], self._any()[:-CRC]
        return first[: self.rng.randrange(len(first) + 1)] + second[
            self.rng.randrange(len(second) + 1) :
        ] * self.rng.choice((0, 1))

    def _lengthened(self) -> bytes:
        body = self._any()[:-CRC]
        at = self.rng.randrange(len(body))
        return sealed(body[:at] + self.rng.choice(LENGTHS) + body[at:])

    def _nested(self) -> bytes:
        depth = self.rng.choice((10, 1_000, 60_000))
        opening = self.rng.choice((b"\x91", b"\x81\xa1x", b"\x81\xa4type"))
        return sealed(opening * depth + self.rng.choice((b"\x01", b"", b"\xc0")))

    def _tree(self) -> dict[str, Any]:
        rng = self.rng
        seq, t = rng.choice(((3, 0.06), (0, 0.0), (rng.randrange(2000), rng.random() * 40.0), (2**53 - 1, 1e9)))
        epoch = rng.choice((EPOCH, EPOCH, EPOCH, 1, 0, EPOCH + 1))
        return sound(rng.choice(MESSAGES), sender=rng.choice(SENDERS), epoch=epoch, seq=seq, t=t)

    def _of_anybody(self) -> bytes:
        return packed(self._tree())

    def _changed(self) -> bytes:
        tree = self._tree()
        for _ in range(self.rng.choice((1, 1, 2, 4))):
            tree = self._with_change(tree)
        try:
            return packed(tree)
        except (OverflowError, msgspec.MsgspecError, UnicodeEncodeError):  # no msgpack has it
            return self._of_anybody()

    def _with_change(self, tree: dict[str, Any]) -> dict[str, Any]:
        rng, tree = self.rng, dict(tree)
        name = rng.choice(list(tree))
        held = tree[name]
        match rng.randrange(10):
            case 0:
                del tree[name]
                tree.setdefault("type", "State")
            case 1:
                tree[rng.choice(TEXTS)] = self._value(None)
            case 2 | 3 | 4 if isinstance(held, list | tuple) and held:
                several = [*held[1:], self._value(held[0])]
                tree[name] = several * rng.choice((1, 1, 1, 300))
            case 2 | 3 | 4 if isinstance(held, dict):
                tree[name] = held | {rng.choice([*held, *TEXTS]): self._value(1.0)}
            case _:
                tree[name] = self._value(held)
        return tree

    def _value(self, held: Any) -> Any:
        """Return a value like the one that is held, or any other."""
        rng = self.rng
        like: tuple[Any, ...] = ()
        match held:
            case int():
                like = held + 1, held + 50, 2 * held + 7, 2**40, not held
            case float():
                like = (
                    held * rng.uniform(-3.0, 3.0),
                    held + rng.uniform(-1.0, 1.0),
                    struct.unpack("<d", rng.randbytes(8))[0],
                )
            case str():
                like = *SENDERS, "a", "b", "open", "close", "down", "stop", "telemetry"
        if like and rng.random() < 0.6:
            return rng.choice(like)
        number, text = rng.choice(NUMBERS), rng.choice(TEXTS)
        others = None, True, [], [number, text], [[text]], {text: number}, {text: {text: [number]}}, rng.randbytes(300)
        return rng.choice((number, number, text, text, rng.choice(others)))
