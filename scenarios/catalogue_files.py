"""The files that come with gridpeers, and a line on each scenario. It imports nothing, so that `list` comes at once."""

from __future__ import annotations

import tomllib
from pathlib import Path

CATALOGUE = Path(__file__).parent / "catalogue"

SWEEPS = CATALOGUE / "sweeps"


def names_in(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))


def summaries() -> dict[str, tuple[str, tuple[str, ...]]]:
    tables = {name: tomllib.loads((CATALOGUE / f"{name}.toml").read_text("utf-8")) for name in names_in(CATALOGUE)}
    return {name: (table["title"], tuple(table["case"])) for name, table in tables.items()}
