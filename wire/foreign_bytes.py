"""Bytes of others that are to be JSON or msgpack of ours: whatever is wrong with them is one kind of error. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import msgspec

from wire.printable import printable

Text = TypeVar("Text", bytes, str)
T = TypeVar("T")


def decode_foreign(decode: Callable[[Text], T], data: Text) -> T:
    r"""Return what is in bytes, or in a text.

    Parameters
    ----------
    decode : Callable[[bytes], T]
        `decode` of a decoder of msgspec.
    data : bytes or str
        What came.

    Raises
    ------
    msgspec.DecodeError
        If it is something else; in one printable line. msgspec itself has other errors for a text that is no UTF-8 and
        for brackets a thousand deep, and repeats the name of a field that it does not know as it came.

    Examples
    --------
    >>> numbers = msgspec.json.Decoder(list[float])
    >>> decode_foreign(numbers.decode, b"[1.5]")
    [1.5]
    >>> decode_foreign(msgspec.json.Decoder().decode, b"[" * 2000)
    Traceback (most recent call last):
    msgspec.DecodeError: maximum recursion depth exceeded while deserializing an object
    """
    try:
        return decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise msgspec.DecodeError(printable(str(error), 200)) from None
