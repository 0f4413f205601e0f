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


@pytest.mark.parametrize(
    ("script", "says", "figure"),
    [
        ("own_feeder.py", "consensus islanding", "own_feeder.png"),
        ("latency_study.py", "event2.swing_pu", ""),
        ("first_figure.py", "inv1 falls to 59.7", "first_figure.png"),
    ],
)
def test_an_example_runs_to_its_end(
    elsewhere: Path, capsys: pytest.CaptureFixture[str], script: str, says: str, figure: str
) -> None:
    """It prints its numbers, and draws its figure into the working directory; in this process, which has all loaded."""
    runpy.run_path(str(EXAMPLES / script), run_name="__main__")

    assert says in capsys.readouterr().out
    assert [path.name for path in elsewhere.iterdir()] == ([figure] if figure else [])


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
"""Each text is asked for, and only the last cell prints."""


def test_from_an_own_law_to_its_figure_are_ten_lines_and_a_text_is_returned_and_not_shown(tmp_path: Path) -> None:
    """The notebook shows its figure as a picture; in its kernel a report, an explanation or a comparison is a string.

    Nothing is shown that nobody prints: the figure, and what the last cell prints.
    """
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
