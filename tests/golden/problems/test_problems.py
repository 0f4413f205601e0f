"""Files with problems, and every message about them, to the letter."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.golden.problems.pin_problems import FILES, messages


@pytest.mark.parametrize("file", FILES, ids=lambda path: path.stem)
def test_every_problem_of_a_file_has_its_pinned_message(file: Path) -> None:
    """Messages keep place, key, value, unit and what would be right; see README.md to change one for the better."""
    assert messages(file) == file.with_suffix(".txt").read_text(encoding="utf-8").splitlines()
