"""`gridpeers init`: a project that runs as it is."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import gridpeers as gp
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
