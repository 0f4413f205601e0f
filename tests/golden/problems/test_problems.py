"""Every message about files with problems, to the letter; `python -m tests.golden.problems.test_problems` pins them."""

from __future__ import annotations

from pathlib import Path

import pytest

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


@pytest.mark.parametrize("file", FILES, ids=lambda path: path.stem)
def test_every_problem_of_a_file_has_its_pinned_message(file: Path) -> None:
    """Messages keep place, key, value, unit and what would be right; see README.md to change one for the better."""
    assert messages(file) == file.with_suffix(".txt").read_text(encoding="utf-8").splitlines()


if __name__ == "__main__":
    for path in FILES:
        path.with_suffix(".txt").write_text("".join(f"{line}\n" for line in messages(path)), encoding="utf-8")
