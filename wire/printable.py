"""Text that is safe on a terminal and in a log: one line of characters that can be seen. Pure."""

from __future__ import annotations

import re

from wire.bounds import UNPRINTABLE

_UNPRINTABLE = re.compile(f"[{UNPRINTABLE}\ud800-\udfff]")


def printable(text: str, limit: int = 4000) -> str:
    r"""Text with what cannot be printed spelt out, cut to a length.

    Whoever sends a text that an error or a file has made passes it through this: one with a control character in it is
    refused by all who receive it.

    Examples
    --------
    >>> print(printable("no solution:\n\x1b[31mred", 60))
    no solution:\x0a\x1b[31mred
    >>> printable("abcdef", 5)
    'ab...'
    """
    text = _UNPRINTABLE.sub(lambda found: f"\\x{ord(found[0]):02x}", text)
    return text if len(text) <= limit else text[: limit - 3] + "..."
