"""The examples; tests/processes has those of `live_run.py` and `foreign_agent.py`."""

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


@pytest.mark.parametrize(
    ("script", "says", "figure"),
    [("own_feeder.py", "consensus islanding", "own_feeder.png"), ("latency_study.py", "event2.swing_pu", "")],
)
def test_an_example_runs_to_its_end(
    elsewhere: Path, capsys: pytest.CaptureFixture[str], script: str, says: str, figure: str
) -> None:
    """It prints its numbers, and draws its figure into the working directory; in this process, which has all loaded."""
    runpy.run_path(str(EXAMPLES / script), run_name="__main__")

    assert says in capsys.readouterr().out
    assert [path.name for path in elsewhere.iterdir()] == ([figure] if figure else [])


def test_the_first_law_restores_the_frequency_that_droop_does_not(elsewhere: Path) -> None:
    """It also keeps the sharing of power equal, and the figure has both cases."""
    runs = runpy.run_path(str(EXAMPLES / "first_figure.py"), run_name="__main__")["runs"]

    assert (runs["I"].metrics["f_error_Hz"] > 0.05).all()
    assert (runs["restore"].metrics["f_error_Hz"] < 0.001).all()
    assert (runs["restore"].metrics["t_restore_s"] < 1.0).all()
    assert (runs["restore"].metrics["MPSI"] < 0.01).all()
    assert [path.name for path in elsewhere.iterdir()] == ["first_figure.png"]


TITLE = "boom:Boom: [bold]IV[/bold]"
TEXTS = ("report", "saved", "why", "compared", "predicted")
CELLS = (
    f"""
events = [{{"label": "event1", "t_s": 1.0, "open": ["13-152"]}}]
short = {{"time.end_s": 1.5, "event": events, "paper": "", "case.IV.title": "{TITLE}"}}
run = gp.load("islanding").replace(short).run("IV")
report = run.report
""",
    "saved = (run.save('here') / 'report.txt').read_text()",
    "why = str(run.decision('inv4', 1.2))",
    "compared = str(gp.compare(run, run))",
    "predicted = str(gp.predict('islanding', 'IV', voltage=False))",
    f"import json; print(json.dumps([{', '.join(TEXTS)}]))",
)
"""Cells that compute the texts; only the last one prints."""


def test_ten_lines_lead_from_a_law_to_its_figure_and_a_notebook_shows_no_text_by_itself(tmp_path: Path) -> None:
    """The notebook shows its figure as a picture. Reports, explanations and comparisons are strings.

    Only the figure and the output of the last cell are shown.
    """
    pytest.importorskip("nbclient", reason="nbclient is not installed (extra ci)")
    book = json.loads((EXAMPLES / "own_law.ipynb").read_text())
    own = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    assert sum(bool(line.strip()) for cell in own for line in cell["source"]) <= 10
    assert all(not cell["outputs"] for cell in own)
    book["cells"] += [{"cell_type": "code", "id": f"c{i}", "metadata": {}, "source": text, "outputs": [],
                       "execution_count": None} for i, text in enumerate(CELLS)]  # fmt: skip
    (tmp_path / "texts.ipynb").write_text(json.dumps(book))

    done = subprocess.run([sys.executable, "-c", EXECUTE, "texts.ipynb"], cwd=tmp_path, capture_output=True, text=True)

    assert done.returncode == 0, done.stderr
    cells = json.loads((tmp_path / "executed.ipynb").read_text())["cells"]
    own, texts = cells[: -len(CELLS)], cells[-len(CELLS) :]
    assert any("image/png" in output.get("data", ()) for cell in own for output in cell.get("outputs", ()))
    assert [len(cell["outputs"]) for cell in texts] == [0, 0, 0, 0, 0, 1]
    got = dict(zip(TEXTS, json.loads("".join(texts[-1]["outputs"][0]["text"])), strict=True))
    assert "Frequency and power sharing after each event" in got["report"]
    assert TITLE in got["report"]
    assert got["saved"].startswith(got["report"].rstrip())
    assert got["why"].startswith("inv4 at t = 1.20 s")
    assert "The histories are the same, byte by byte." in got["compared"]
    assert "inv1" in got["predicted"] or "mode" in got["predicted"]
