"""Messages to bytes and back, and the count of what was refused on the way.

msgpack through msgspec, which checks types and bounds while it decodes, and the CRC-32 of that in the last four bytes:
TCP's checksum of 16 bits lets an error through now and then, and a bit flipped within a number would decode as another
number. So a message that comes out of `decode` is as it was sent, and within the bounds of `wire.bounds`. Whatever is
not is a `RejectedError` of one of the kinds in `KINDS`: receivers count it and go on, as no message may stop an agent.
"""

from __future__ import annotations

import re
import traceback
from collections import Counter
from math import isfinite
from typing import Any
from zlib import crc32

import msgspec

from wire.bounds import LIMIT
from wire.messages import AnyMessage, Message
from wire.printable import printable

CRC = 4
"""Bytes of the checksum at the end: CRC-32 as in zlib and Ethernet, least significant byte first."""

_SOUND = 0x2144DF1C
"""CRC-32 of whatever ends in its own CRC-32: so one call checks a message, without taking it apart."""

KINDS = {
    "oversized": "longer than a message may be",
    "corrupt": "not as it was sent, or sent without a checksum: its CRC-32 is another",
    "garbled": "not msgpack, or not the fields of its type",
    "unknown": "of a type that nobody here knows",
    "not finite": "a number in it is NaN or infinite",
    "implausible": "a value in it is beyond what can be, or contradicts another",
    "foreign": "on a key of another run, or not sent by whom the key says",
    "ghost": "from another life of its sender than the one that counts",
    "stale": "about a tick or a roster that is over",
    "unexpected": "well-formed, but not for here and now",
    "failed": "an error of ours came up while it was handled, see its traceback",
}
"""The kinds of rejects and what each means."""

_encoder = msgspec.msgpack.Encoder()
_decoder: msgspec.msgpack.Decoder[AnyMessage] = msgspec.msgpack.Decoder(AnyMessage)


TRACED = 40
"""Last lines of a traceback that are logged."""


class RejectedError(Exception):
    """A message that must be dropped.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    text : str
        What is wrong with this one.
    """

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind
        self.text = text


def encode(message: Message) -> bytes:
    """Bytes of a message; the same message gives the same bytes in every process."""
    body = _encoder.encode(message)
    return body + crc32(body).to_bytes(CRC, "little")


def decode(payload: bytes) -> AnyMessage:
    """Message of the bytes, whole and within its bounds, or `RejectedError`.

    Examples
    --------
    >>> from wire.messages import Ready
    >>> decode(encode(Ready(sender="inv1", epoch=1, seq=0, t=0.0))).sender
    'inv1'
    """
    if len(payload) > LIMIT:
        raise RejectedError("oversized", f"{len(payload)} bytes, at most {LIMIT} are allowed")
    if crc32(payload) != _SOUND:
        raise RejectedError("corrupt", f"{len(payload)} bytes that do not end in their CRC-32")
    try:
        return _decoder.decode(payload[:-CRC])
    except msgspec.ValidationError as error:
        raise RejectedError(_kind(str(error), payload), str(error)) from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise RejectedError("garbled", str(error)) from None


_WRONG_TYPE = re.compile(r"^(Expected `[^`]*`, got |Object |Invalid |\w+ value out of range)")
"""How msgspec begins where no value is wrong. Bounds, and what a message finds by itself, read otherwise."""


def _kind(text: str, payload: bytes) -> str:
    if text.endswith("`$.type`"):
        return "unknown"
    if _WRONG_TYPE.match(text):
        return "garbled"
    try:
        return "implausible" if _is_finite(msgspec.msgpack.decode(payload[:-CRC])) else "not finite"
    except (ValueError, TypeError, RecursionError):  # behind the value that is wrong there may be anything
        return "implausible"


def _is_finite(value: Any) -> bool:
    """Whether there is no NaN and no infinity among the numbers of a message."""
    if isinstance(value, float):
        return isfinite(value)
    if isinstance(value, dict):
        return all(map(_is_finite, value.values()))
    return not isinstance(value, list) or all(map(_is_finite, value))


class RejectedMessages:
    """Counts dropped messages by kind and keeps one log line per kind.

    Parameters
    ----------
    who : str
        Name of the receiver, for the log lines.
    """

    def __init__(self, who: str) -> None:
        self.counts: Counter[str] = Counter()
        self._who = who
        self._lines: list[str] = []

    def add(self, kind: str, key: str, text: str, trace: str = "") -> None:
        """Count one; the first of its kind is worth a line, and the traceback of an error of ours."""
        assert kind in KINDS
        if not self.counts[kind]:
            line = (
                f"{self._who}: dropped a message on {key}: {kind} ({KINDS[kind]}): {printable(text, 200)}. "
                "More of this kind are only counted. See docs/protocol.md"
            )
            self._lines.append("\n".join([line, *(printable(row, 200) for row in trace.splitlines()[-TRACED:])]))
        self.counts[kind] += 1

    def failed(self, key: str, error: Exception) -> None:
        """Count a message on which an error of ours came up, which is being handled now."""
        self.add("failed", key, f"{type(error).__name__}: {error}", traceback.format_exc())

    @property
    def has_lines(self) -> bool:
        """Whether there are log lines to take."""
        return bool(self._lines)

    def take_lines(self) -> tuple[str, ...]:
        """Log lines since last taken."""
        lines, self._lines = tuple(self._lines), []
        return lines
