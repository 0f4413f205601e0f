"""Names of inverters in the order in which people count, and many of them in few characters."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import groupby


def in_order(names: Iterable[str]) -> list[str]:
    """Names in the order in which people count: inv2 before inv10."""
    return sorted(names, key=lambda name: (name.rstrip("0123456789"), len(name), name))


def short(names: tuple[str, ...] | list[str]) -> str:
    """Names of one stem and running numbers in few characters; "-" for none.

    Examples
    --------
    >>> short(["inv1", "inv3", "inv4", "inv5", "north"])
    'inv1,3-5 north'
    >>> short([])
    '-'
    """
    parts = [re.fullmatch(r"(.*?)(\d*)", name, re.DOTALL) for name in names]
    split = [(match[1], match[2]) for match in parts if match is not None]
    words = []
    for stem, group in groupby(split, key=lambda part: (part[0], bool(part[1]))):
        if not stem[1]:
            words += [name for name, _ in group]
            continue
        numbers = sorted(int(number) for _, number in group)
        runs = [
            [number for _, number in run]
            for _, run in groupby(enumerate(numbers), key=lambda place: place[1] - place[0])
        ]
        words.append(
            stem[0] + ",".join(f"{run[0]}-{run[-1]}" if len(run) > 2 else ",".join(map(str, run)) for run in runs)
        )
    return " ".join(words) or "-"
