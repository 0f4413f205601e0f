"""Text that is safe on a terminal and in a log: one line of visible characters. Pure."""

from __future__ import annotations

import re

from gridpeers.wire.bounds import UNPRINTABLE

_UNPRINTABLE = re.compile(f"[{UNPRINTABLE}\ud800-\udfff]")


def printable(text: str, limit: int = 4000) -> str:
    r"""Return a text with its unprintable characters spelt out, cut to a length.

    Pass every text from an error or a file through this before you send it: receivers reject a text with a control
    character.

    Examples
    --------
    >>> print(printable("no solution:\n\x1b[31mred", 60))
    no solution:\x0a\x1b[31mred
    >>> printable("abcdef", 5)
    'ab...'
    """
    text = _UNPRINTABLE.sub(lambda match: f"\\x{ord(match[0]):02x}", text)
    return text if len(text) <= limit else text[: limit - 3] + "..."


def utf8(text: str) -> str:
    r"""Return a text for a file: what Python keeps of bytes that are no UTF-8, as in names of files, is spelt out.

    Examples
    --------
    >>> utf8(b"no such file: caf\xe9".decode("utf-8", "surrogateescape"))
    'no such file: caf\\udce9'
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
