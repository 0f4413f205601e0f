"""Texts that somebody gives as a path. Pure."""

from __future__ import annotations


def is_no_path(text: str) -> bool:
    r"""Whether a text names no file on any system: too long, or with what no name has.

    Examples
    --------
    >>> is_no_path("a\0b"), is_no_path("x" * 300), is_no_path("laws/größe.py"), is_no_path("\ud800")
    (True, True, False, True)
    """
    try:
        raw = text.encode()
    except UnicodeEncodeError:  # half a character
        return True
    return b"\0" in raw or len(raw) > 4000 or any(len(part) > 255 for part in raw.split(b"/"))
