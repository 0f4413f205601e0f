"""The stored measurements: docs/performance.json, by part; each part has its own date, commit, load and versions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import msgspec

from bench.peers.measured import PartRun
from scenarios.results.run_files import write_whole

DATA_FILE = "performance.json"

Parts = Mapping[str, PartRun]


class StoredError(ValueError):
    """A file of measurements that cannot be read."""


def read_parts(file: Path) -> dict[str, PartRun]:
    """Return the measurements of a file; none where there is none.

    Raises
    ------
    StoredError
        If the file is something else.
    """
    if not file.exists():
        return {}
    try:
        return msgspec.json.decode(file.read_bytes(), type=dict[str, PartRun])
    except (OSError, msgspec.DecodeError) as error:
        raise StoredError(f"{file}: no measurements of this bench: {error}; move it away, or name another") from None


def save_parts(parts: Parts, file: Path) -> None:
    """Write measurements; a reader, or a run that is interrupted, finds the file as it was before or whole."""
    file.parent.mkdir(parents=True, exist_ok=True)
    text = msgspec.json.format(msgspec.json.encode(parts), indent=1).decode()
    write_whole(file, text + "\n")
