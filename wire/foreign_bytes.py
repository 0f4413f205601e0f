"""Decode JSON or msgpack that another program wrote: whatever is wrong with it is one kind of error. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import msgspec

from gridpeers.wire.printable import printable

Text = TypeVar("Text", bytes, str)
T = TypeVar("T")


def decode_foreign(decode: Callable[[Text], T], data: Text) -> T:
    r"""Return the value that bytes or a text encode.

    Parameters
    ----------
    decode : Callable[[bytes], T]
        `decode` of a decoder of msgspec.
    data : bytes or str
        The bytes, or the text.

    Raises
    ------
    msgspec.DecodeError
        If they encode no such value; in one printable line. msgspec itself has other errors for a text that is no UTF-8
        and for brackets a thousand deep, and repeats the name of a field that it does not know as it came.

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
