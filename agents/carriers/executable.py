"""Whether the system can run a file that is marked as executable, as far as its first bytes tell."""

from __future__ import annotations

import shutil
from pathlib import Path

_BINARY = (b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"MZ")
"""First bytes of programs for Linux, of macOS and of Windows; the last may be run by an emulator."""


def executable_problem(file: Path) -> str:
    """Return why the system cannot run a file, as the end of a sentence; "" if it may.

    Examples
    --------
    >>> executable_problem(Path(__file__))
    'has no first line such as #!/usr/bin/env python3, and is no compiled program; write one, or name its ...'
    """
    try:
        with file.open("rb") as opened:
            first = opened.readline(256)
    except OSError:  # a program that may be run but not read
        return ""
    if first.startswith(_BINARY):
        return ""
    if not first.startswith(b"#!"):
        return (
            "has no first line such as #!/usr/bin/env python3, and is no compiled program; write one, or name its "
            "interpreter first"
        )
    interpreter, _, argument = first[2:].decode(errors="replace").strip().partition(" ")
    if first.endswith(b"\r\n"):
        return "has lines that end as those of Windows, which #! cannot have; write it with Unix line ends"
    if not Path(interpreter).is_file():
        return f"asks in its first line for {interpreter or 'nothing'}, and there is no such program"
    if Path(interpreter).name == "env" and not argument.startswith("-") and not shutil.which(argument.strip()):
        return f"asks in its first line for {argument.strip() or 'nothing'}, which is not on the PATH"
    return ""
