"""feeder.toml: what holds for a feeder as a whole. The file may be missing."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from gridpeers.plant.tables.feeder_columns import Manifest
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.text_file import TextFileError, text_of

MANIFEST = "feeder.toml"
"""Name of the file."""


def read_f_nom(folder: Path, problems: list[str]) -> float:
    """Return the nominal frequency (Hz) of a feeder; without a file, 60 Hz."""
    manifest, found = read_table(Manifest, _tables(folder / MANIFEST, problems))
    problems += [f"{MANIFEST}: {path}: {text}" for path, text in found]
    return manifest.f_nom_Hz


def _tables(path: Path, problems: list[str]) -> dict[str, Any]:
    try:
        return tomllib.loads(text_of(path.read_bytes()))
    except FileNotFoundError:
        return {}
    except OSError as error:
        problems.append(f"{path.name}: cannot be read: {error.strerror}")
    except TextFileError as error:
        problems.append(f"{path.name}: {error}")
    except (ValueError, RecursionError) as error:
        problems.append(f"{path.name}: not valid TOML: {error}")
    return {}
