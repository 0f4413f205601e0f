"""checks.json: the verdicts of a run, by case, as a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import msgspec

from gridpeers.scenarios.checks.check_verdict import CheckVerdict

FILE = "checks.json"
"""Name of the file in the run folder."""

Verdicts = Mapping[str, tuple[CheckVerdict, ...]]
"""Verdicts of a run by case, in the order of the checks."""

_decoder = msgspec.json.Decoder(dict[str, tuple[CheckVerdict, ...]])


def verdicts_json(verdicts: Verdicts) -> str:
    """Return the text of checks.json."""
    return msgspec.json.format(msgspec.json.encode(verdicts), indent=1).decode() + "\n"


def read_verdicts(path: Path) -> dict[str, tuple[CheckVerdict, ...]]:
    """Read a checks.json.

    Raises
    ------
    ValueError
        If it is none.
    """
    return _decoder.decode(path.read_bytes())
