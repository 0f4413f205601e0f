"""`gridpeers init`: a project that runs as it is."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.output_folders import whole_folder
from tests.command_line import invoke

pytestmark = pytest.mark.usefixtures("elsewhere")


def test_a_new_project_runs_and_its_test_passes(elsewhere: Path) -> None:
    """Scenario, law and test come out of the box."""
    code, text = invoke("init", "study")
    assert code == 0
    assert "study/mine.py" in text

    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    path = {"PYTHONPATH": str(Path(gp.__file__).parents[1])}
    done = subprocess.run(words, cwd="study", env=os.environ | path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_a_folder_that_another_command_fills_is_left_to_it(elsewhere: Path) -> None:
    """One that ends early empties its folder: what the other has written must not go with it."""
    with whole_folder(elsewhere / "study"):
        code, text = invoke("init", "study")
        (elsewhere / "study" / "notes.txt").write_text("of the other")

    assert (code, text) == (2, "gridpeers: study: another command is writing in it; give another folder\n")
    assert [path.name for path in (elsewhere / "study").iterdir()] == ["notes.txt"]
