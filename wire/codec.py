"""Messages to bytes and back, and the count of what was refused on the way.

msgpack through msgspec, which checks types and bounds while it decodes, and the CRC-32 of that in the last four bytes:
TCP's checksum of 16 bits lets an error through now and then, and a bit flipped within a number would decode as another
number. So a message that comes out of `decode` is as it was sent, and its numbers are finite. Whatever is not is a
`RejectedError` of one of the kinds in `KINDS`: receivers count it and go on, as no message may stop an agent.
"""

from __future__ import annotations

from collections import Counter
from zlib import crc32

import msgspec

from wire.messages import AnyMessage, Message

LIMIT = 64_000
"""Longest message in bytes: what Zenoh sends in one piece, and tenfold what any message but Telemetry needs."""

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
    "foreign": "on a key of another run, or not sent by whom the key says",
    "ghost": "from an earlier life of its sender",
    "stale": "about a tick or a roster that is over",
    "unexpected": "well-formed, but not for here and now",
}
"""The kinds of rejects and what each means."""

_encoder = msgspec.msgpack.Encoder()
_decoder: msgspec.msgpack.Decoder[AnyMessage] = msgspec.msgpack.Decoder(AnyMessage)


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
    """Message of the bytes, whole and finite, or `RejectedError`.

    Examples
    --------
    >>> from wire.messages import Ready
    >>> decode(encode(Ready(sender="inv1", incarnation=1, seq=0, t=0.0))).sender
    'inv1'
    """
    if len(payload) > LIMIT:
        raise RejectedError("oversized", f"{len(payload)} bytes, at most {LIMIT} are allowed")
    if crc32(payload) != _SOUND:
        raise RejectedError("corrupt", f"{len(payload)} bytes that do not end in their CRC-32")
    try:
        return _decoder.decode(payload[:-CRC])
    except msgspec.ValidationError as error:
        raise RejectedError(_kind(str(error)), str(error)) from None
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise RejectedError("garbled", str(error)) from None


def _kind(text: str) -> str:
    if text.endswith("`$.type`"):
        return "unknown"
    return "not finite" if "1e+300" in text else "garbled"


class Rejects:
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

    def add(self, kind: str, key: str, text: str) -> None:
        """Count one; the first of its kind is worth a line."""
        assert kind in KINDS
        if not self.counts[kind]:
            self._lines.append(
                f"{self._who}: dropped a message on {key}: {kind} ({KINDS[kind]}): {text[:200]}. "
                "More of this kind are only counted. See docs/protocol.md"
            )
        self.counts[kind] += 1

    @property
    def has_lines(self) -> bool:
        """Whether there are log lines to take."""
        return bool(self._lines)

    def take_lines(self) -> tuple[str, ...]:
        """Log lines since last taken."""
        lines, self._lines = tuple(self._lines), []
        return lines
