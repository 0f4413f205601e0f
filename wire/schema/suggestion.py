"""Names in a message: the first of many; of an unknown one, what was probably meant, and what there is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

LONGEST_LIST = 30
"""Names that are listed at the most: all commands, or keys of a table of a scenario, but not all buses of a feeder."""

SHORTEST_START = 3
"""Letters from which on the start of a name is taken for the name; "in" may be anything."""


def suggestion(wrong: str, known: Iterable[str], what: str, also: Iterable[str] = ()) -> str:
    """Sentence that names what was probably meant and what there is.

    Parameters
    ----------
    wrong : str
        The unknown name.
    known : Iterable[str]
        All names that there are, in the order in which a reader wants them.
    what : str
        What they name, in the plural.
    also : Iterable[str], optional
        Other names for the same things: they may be meant too, and are not listed.

    Examples
    --------
    >>> suggestion("Inv22", ["inv1", "inv2"], "inverters")
    'did you mean "inv2"? The inverters are inv1, inv2'
    >>> suggestion("sw12", ["13-152", "60-160"], "switches", also=["sw1_2"])
    'did you mean "sw1_2"? The switches are 13-152, 60-160'

    A long list is left out beside a name that is near, and cut else:

    >>> suggestion("47x", map(str, range(1, 135)), "buses")
    'did you mean "47"?'
    >>> suggestion("zebra", map(str, range(1, 135)), "buses")  # doctest: +ELLIPSIS
    'the buses are 1, 2, 3, ..., 30 and 104 more'
    """
    names = list(known)
    near = _nearest(str(wrong), [*names, *also])
    beyond = len(names) - LONGEST_LIST
    if near and beyond > 0:
        return f'did you mean "{near}"?'
    there = f"he {what} are {first_of(names, LONGEST_LIST)}" if names else f"here are no {what}"
    return f'did you mean "{near}"? T{there}' if near else f"t{there}"


def first_of(names: Sequence[str], most: int) -> str:
    """Return the first names of a list, so many at the most, and how many more there are.

    Examples
    --------
    >>> first_of(["inv1", "inv2", "inv3"], 2), first_of(["inv1", "inv2"], 2)
    ('inv1, inv2 and 1 more', 'inv1, inv2')
    """
    beyond = len(names) - most
    return ", ".join(names[:most]) + (f" and {beyond} more" if beyond > 0 else "")


def _nearest(wrong: str, names: list[str]) -> str:
    """The name that begins so, else the one that is most alike, whatever the case of letters; "" if none is."""
    import difflib  # takes longer to import than an agent's configuration to read, and few ever need it

    by_lower = {name.lower(): name for name in names}
    wrong = wrong.lower()
    longer = [name for name in by_lower if len(wrong) >= SHORTEST_START and name.startswith(wrong)]
    near = sorted(longer, key=len)[:1] or difflib.get_close_matches(wrong, by_lower, n=1)
    return by_lower[near[0]] if near else ""
