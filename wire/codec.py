"""Messages to bytes and back, and the count of rejected messages.

A payload is msgpack, by msgspec, which checks types and bounds while it decodes, and its CRC-32 in the last four bytes:
TCP's checksum of 16 bits misses an error now and then, and a flipped bit within a number would decode as another
number. So a message from `decode` is as it was sent, and within its bounds. Any other payload raises a
`RejectedError` of a kind in `KINDS`: receivers count it and continue, because no message may stop an agent.
"""

from __future__ import annotations

import re
import traceback
from collections import Counter
from collections.abc import Callable
from typing import TypeVar
from zlib import crc32

import msgspec

from gridpeers.wire.messages import LONGEST_MESSAGE, AnyMessage, Message
from gridpeers.wire.wording import printable

CRC = 4  # Bytes of the checksum at the end: CRC-32 as in zlib and Ethernet, least significant byte first
_SOUND = 0x2144DF1C  # CRC-32 of any bytes that end in their own CRC-32: so one call checks a whole payload

KINDS = {
    "oversized": "longer than a message may be",
    "corrupt": "changed on its way, or sent without a checksum: its CRC-32 differs",
    "garbled": "not msgpack, or not the fields of its type",
    "unknown": "of an unknown type",
    "implausible": "a value in it is NaN or beyond its physical bounds, or contradicts another",
    "foreign": "on a key of another run, or from another sender than the key names",
    "impostor": "from a process whose link has a certificate of another name",
    "ghost": "from another epoch than the sender's valid one",
    "stale": "about a past tick or roster",
    "excess": "dropped unread, or unanswered: more came than this process takes at once",
    "unexpected": "well-formed, but not for this receiver at this time",
    "failed": "its handling raised an error of gridpeers, see the traceback",
}

_encoder = msgspec.msgpack.Encoder()
_latest: tuple[bytes | None, AnyMessage] = (None, None)  # type: ignore[assignment]
"""The last payload and its message: the nodes of one process get the same payload one after the other."""

_decoder: msgspec.msgpack.Decoder[AnyMessage] = msgspec.msgpack.Decoder(AnyMessage)


class RejectedError(Exception):
    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind, self.text = kind, text


def encode(message: Message) -> bytes:
    """Return the bytes of a message; the same message gives the same bytes in every process."""
    body = _encoder.encode(message)
    return body + crc32(body).to_bytes(CRC, "little")


def payload_of(message: AnyMessage) -> bytes:
    """Return the bytes as which a message came, if none has come since; else those that `encode` makes."""
    payload, latest = _latest
    return payload if message is latest and payload is not None else encode(message)


def decode(payload: bytes) -> AnyMessage:
    """Return the message of a payload, whole and within its bounds; raise RejectedError for any other payload."""
    global _latest
    if payload is _latest[0]:
        return _latest[1]
    if len(payload) > LONGEST_MESSAGE:
        raise RejectedError("oversized", f"{len(payload)} bytes, at most {LONGEST_MESSAGE} are allowed")
    if crc32(payload) != _SOUND:
        raise RejectedError("corrupt", f"{len(payload)} bytes that do not end in their CRC-32")
    try:
        message = _decoder.decode(payload[:-CRC])
    except msgspec.ValidationError as error:
        raise RejectedError(_kind(str(error)), str(error)) from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise RejectedError("garbled", str(error)) from None
    _latest = payload, message
    return message


def sound(payload: bytes) -> AnyMessage | None:
    try:
        return decode(payload)
    except RejectedError:
        return None


_WRONG_TYPE = re.compile(r"^(Expected `[^`]*`, got |Object |Invalid |\w+ value out of range)")
"""Start of msgspec's message for a wrong type; for a bound, or a message's own check, it reads otherwise."""


def _kind(text: str) -> str:
    if text.endswith("`$.type`"):
        return "unknown"
    return "garbled" if _WRONG_TYPE.match(text) else "implausible"


class RejectedMessages:
    def __init__(self, who: str) -> None:
        self.counts: Counter[str] = Counter()
        self._who = who
        self._lines: list[str] = []

    def add(self, kind: str, key: str, text: str, trace: str = "", count: int = 1) -> None:
        """Count messages; write a line for the first of its kind, with the traceback of an error of ours."""
        assert kind in KINDS
        if not self.counts[kind]:
            line = (
                f"{self._who}: dropped a message on {key}: {kind} ({KINDS[kind]}): {printable(text, 200)}. "
                "More of this kind are only counted. docs/reference/protocol.md explains the kinds."
            )
            self._lines.append("\n".join([line, *(printable(row, 200) for row in trace.splitlines()[-40:])]))
        self.counts[kind] += count

    def failed(self, key: str, error: Exception) -> None:
        trace = "" if self.counts["failed"] else traceback.format_exc()
        self.add("failed", key, f"{type(error).__name__}: {error}", trace)

    def take_lines(self) -> tuple[str, ...]:
        if not self._lines:
            return ()
        lines, self._lines = tuple(self._lines), []
        return lines


Text = TypeVar("Text", bytes, str)
T = TypeVar("T")


def decode_foreign(decode: Callable[[Text], T], data: Text) -> T:
    """Return the value of bytes or a text; raise `msgspec.DecodeError` in one printable line if there is none.

    msgspec itself raises other errors for a text that is no UTF-8 and for brackets a thousand deep, and quotes the name
    of an unknown field as it came.
    """
    try:
        return decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise msgspec.DecodeError(printable(str(error), 200)) from None
