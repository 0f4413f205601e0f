"""Find errors and warnings in the lines that GridLAB-D has printed."""

from __future__ import annotations

import re
from pathlib import Path

from gridpeers.wire.wording import printable

PLACED = re.compile(r"^(?P<file>\S[^()]*)\((?P<line>\d+)\)\s*: (?P<text>.*)$")
"""A message of the loader: file, line, text."""

LEVELLED = re.compile(r"^(?:ERROR|FATAL)\s+\[[^\]]*\]\s*: (?P<text>.*)$")
"""A message of the simulation that ends it."""

FOLLOWING = re.compile(
    r"load failed at or near|#include failed|unable to load '|failed to load model file|model initialization failed"
    r"|run_preparation\(\) returned|shutdown after simulation|last (error|warning) message was repeated"
    r"|Failed to initialize simulation|initialization failed$|dump complete to|tzinfo\.txt|environment startup failed"
)
"""Messages that only repeat that something failed."""


def messages(printed: str) -> list[str]:
    r"""Return what GridLAB-D complains of, each message once; what only repeats that something failed if nothing else.

    Examples
    --------
    >>> messages("x.glm(3): class 'foo' is not known\nx.glm(3): load failed at or near 'object foo'\n")
    ["x.glm:3: class 'foo' is not known"]
    >>> messages("ERROR    [INIT] : NR: no swing bus found\nWARNING  [INIT] : slow\n")
    ['GridLAB-D: NR: no swing bus found']
    """
    found: list[str] = []
    following: list[str] = []
    missing = ""
    for line in printed.replace("\r", "\n").splitlines():
        placed, levelled = PLACED.match(line), LEVELLED.match(line)
        if placed and placed["text"].startswith("include file open failed"):
            missing = placed["file"]  # its line is that of the file that includes it, which the next message names
            continue
        if placed and missing:
            found.append(f"{Path(placed['file']).name}:{placed['line']}: {missing} is included, and cannot be read")
            missing = ""
            continue
        if placed:
            text = f"{Path(placed['file']).name}:{placed['line']}: {printable(placed['text'].strip())}"
        elif levelled:
            text = f"GridLAB-D: {printable(levelled['text'].strip())}"
        else:
            continue
        (following if FOLLOWING.search(line) else found).append(text)
    found.sort(key=lambda text: text.startswith("GridLAB-D: "))  # those with a file and a line come first
    return list(dict.fromkeys(found or following))
