"""The text of a script of another program, in whatever encoding it is. Pure."""

from __future__ import annotations

import codecs

MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""Encodings of files that begin with a mark of theirs."""


def decoded(data: bytes) -> str:
    """Return the text of a script: in the encoding of its mark, else UTF-16, UTF-8 or that of Windows.

    Examples
    --------
    >>> [decoded("bus São".encode(encoding)) for encoding in ("latin-1", "utf-16", "utf-16-be", "utf-8-sig")]
    ['bus São', 'bus São', 'bus São', 'bus São']
    """
    for mark, encoding in MARKS:
        if data.startswith(mark):
            return data.decode(encoding, errors="replace")
    if data.count(0) > len(data) // 4:  # Latin letters have a zero as every second byte
        return data.decode("utf-16-le" if data[1::2].count(0) > data[::2].count(0) else "utf-16-be", errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")
