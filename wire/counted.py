"""A number of things in words. Pure."""

from __future__ import annotations


def counted(number: int, one: str, several: str = "") -> str:
    """Return a number of things with its noun.

    Parameters
    ----------
    number : int
        How many.
    one : str
        The noun for one of them.
    several : str, optional
        The noun for more, or none; by default with an s.

    Examples
    --------
    >>> counted(1, "switch", "switches"), counted(2, "switch", "switches"), counted(0, "inverter")
    ('1 switch', '2 switches', '0 inverters')
    """
    return f"{number} {one if number == 1 else several or f'{one}s'}"
