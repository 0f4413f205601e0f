"""Texts for people, made short: names of inverters, lengths of time, columns. Pure."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Iterator, Sequence
from itertools import groupby


def in_order(names: Iterable[str]) -> list[str]:
    """Names in the order in which people count: inv2 before inv10."""
    return sorted(names, key=lambda name: (name.rstrip("0123456789"), len(name), name))


def short(names: tuple[str, ...] | list[str]) -> str:
    """Return names of one stem and running numbers in few characters, as "inv1,3-5 north"; "-" for none."""
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


_UNITS = ((120, 1, "s"), (7200, 60, "min"), (172_800, 3600, "h"), (math.inf, 86_400, "days"))


def duration(seconds: float) -> str:
    """Return a length of time (s) in words, of two digits: more would promise too much."""
    unit, name = next((unit, name) for bound, unit, name in _UNITS if seconds < bound)
    return f"{float(f'{seconds / unit:.2g}'):g} {name}"


def aligned(rows: Sequence[Sequence[str]], right: Container[int]) -> Iterator[str]:
    """Yield the lines of a table, two blanks between its columns; `right` has those that end in line."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield "  ".join(cells).rstrip()
