"""Small sweeps: 0.3 s of the islanding experiment, some 50 ms a run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

HEAD = """
scenario = "islanding"
cases = ["IV"]

[set]
paper = ""
"time.end_s" = 0.3
event = [{ label = "event1", t_s = 0.1, open = ["13-152"] }]
"""

Write = Callable[[str], Path]


@pytest.fixture
def sweep_file(tmp_path: Path) -> Write:
    """Writes a sweep file: the head above and what is varied, or with `scenario = ` in it the text alone."""

    def write(text: str) -> Path:
        path = tmp_path / "mine.toml"
        path.write_text(text if "scenario = " in text else HEAD + text, encoding="utf-8")
        return path

    return write
