"""Pin the messages about files with mistakes anew: `python -m tests.golden.mistakes.pin_mistakes`."""

from __future__ import annotations

from pathlib import Path

from scenarios.spec import ScenarioError, load_scenario
from scenarios.sweep.file import read_sweep

FILES = sorted(Path(__file__).parent.glob("*.toml"))
"""Scenario files and, where the name begins with `sweep`, sweep files; none of them can be run."""


def messages(file: Path) -> list[str]:
    """Return all messages about a file, wherever the clone is."""
    try:
        (read_sweep if file.name.startswith("sweep") else load_scenario)(file)
    except ScenarioError as error:
        folder = str(file.parent)
        return [line.replace(folder, "FOLDER") for mistake in error.mistakes for line in mistake.splitlines()]
    return []


if __name__ == "__main__":
    for path in FILES:
        path.with_suffix(".txt").write_text("".join(f"{line}\n" for line in messages(path)), encoding="utf-8")
