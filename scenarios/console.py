"""Text for people: the terminal or string that it goes to, where it is printed as it is; and what is made short.

Names and titles are a user's: "[bold]" and ":boom:" are no markup and no picture. A notebook's kernel shows what is
printed, and returns what is a string: rich would show both, and return nothing.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from itertools import groupby
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

_WIDE = 10_000  # Characters of a line that nobody's sentence reaches: text in a file is not wrapped


def terminal(**options: Any) -> Console:
    """Return a console on standard output, with colours if that is a terminal; rich's options change that."""
    from rich.console import Console  # it takes longer to import than a command that prints nothing

    return Console(force_jupyter=False, markup=False, emoji=False, highlight=False, **options)


def text_of(print_on: Callable[[Console], None]) -> str:
    """Return the text that a function prints on a console, without blanks at the ends of lines."""
    console = terminal(width=_WIDE, color_system=None, force_terminal=False)
    with console.capture() as printed:
        print_on(console)
    return "\n".join(line.rstrip() for line in printed.get().split("\n"))


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
