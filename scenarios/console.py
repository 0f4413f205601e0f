"""Where text for people goes: the terminal of a command, or a string. Every text is printed as it is.

Names and titles are a user's: "[bold]" and ":boom:" are no markup and no picture. A notebook's kernel shows what is
printed, and returns what is a string: rich would show both, and return nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from io import StringIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

_WIDE = 10_000
"""Characters of a line that nobody's sentence reaches: text in a file is not wrapped."""


def terminal(**options: Any) -> Console:
    """Return a console on standard output, with colours if that is a terminal; rich's options change that."""
    from rich.console import Console  # it takes longer to import than a command that prints nothing

    return Console(force_jupyter=False, markup=False, emoji=False, highlight=False, **options)


def text_of(print_on: Callable[[Console], None]) -> str:
    """Return the text that a function prints on a console, without blanks at the ends of lines."""
    text = StringIO()
    print_on(terminal(file=text, width=_WIDE, color_system=None, force_terminal=False))
    return "\n".join(line.rstrip() for line in text.getvalue().split("\n"))
