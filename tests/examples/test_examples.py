"""The examples do what they say; `examples/live_run.py` and `foreign_agent.py` are in tests/processes."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"

EXECUTE = """
import sys, nbformat
from nbclient import NotebookClient
book = nbformat.read(sys.argv[1], 4)
NotebookClient(book, timeout=250, startup_timeout=250, kernel_name="python3").execute()
nbformat.write(book, "executed.ipynb")
"""


def outputs(folder: Path, *words: str) -> str:
    """Return what a script prints, started in a folder where it may draw."""
    done = subprocess.run([sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("script", "says", "figure"),
    [("own_feeder.py", "consensus islanding", "own_feeder.png"), ("latency_study.py", "event2.swing_pu", "")],
)
def test_an_example_runs_to_its_end(tmp_path: Path, script: str, says: str, figure: str) -> None:
    """It prints its numbers, and draws its figure into the working directory."""
    text = outputs(tmp_path, str(EXAMPLES / script))

    assert says in text
    assert [path.name for path in tmp_path.iterdir()] == ([figure] if figure else [])


def test_the_first_figure_is_drawn(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Four cases as tables and as a figure; in this process, which has the libraries already."""
    runpy.run_path(str(EXAMPLES / "first_figure.py"), run_name="__main__")

    assert "inv1 falls to 59.7" in capsys.readouterr().out
    assert [path.name for path in elsewhere.iterdir()] == ["first_figure.png"]


def test_from_an_own_law_to_its_figure_are_ten_lines(tmp_path: Path) -> None:
    """The notebook has at most ten lines of code, and shows the figure as a picture."""
    book = EXAMPLES / "own_law.ipynb"
    cells = [cell for cell in json.loads(book.read_text())["cells"] if cell["cell_type"] == "code"]
    assert sum(bool(line.strip()) for cell in cells for line in cell["source"]) <= 10
    assert all(not cell["outputs"] for cell in cells)

    outputs(tmp_path, "-c", EXECUTE, str(book))

    executed = json.loads((tmp_path / "executed.ipynb").read_text())
    shown = [output["data"] for cell in executed["cells"] for output in cell.get("outputs", ())]
    assert any("image/png" in data for data in shown)
