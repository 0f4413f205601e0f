"""Pin the messages about files with problems anew: `python -m tests.golden.problems.pin_problems`."""

from __future__ import annotations

from pathlib import Path

from gridpeers.scenarios.schema import ScenarioError, load_scenario
from gridpeers.scenarios.sweep.sweep_reading import read_sweep

FILES = sorted(Path(__file__).parent.glob("*.toml"))
"""Scenario files and, where the name begins with `sweep`, sweep files; none of them can be run."""


def messages(file: Path) -> list[str]:
    """Return all messages about a file, wherever the clone is."""
    try:
        (read_sweep if file.name.startswith("sweep") else load_scenario)(file)
    except ScenarioError as error:
        folder = str(file.parent)
        return [line.replace(folder, "FOLDER") for problem in error.problems for line in problem.splitlines()]
    return []


if __name__ == "__main__":
    for path in FILES:
        path.with_suffix(".txt").write_text("".join(f"{line}\n" for line in messages(path)), encoding="utf-8")
