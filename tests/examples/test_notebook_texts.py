"""In a notebook's kernel a text is a string with what it says, and nothing is shown that nobody prints."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from tests.examples.test_examples import EXECUTE

TITLE = "boom:Boom: [bold]IV[/bold]"

CELLS = (
    f"""
import gridpeers as gp
events = [{{"label": "event1", "t_s": 1.0, "open": ["13-152"]}}]
short = {{"time.end_s": 1.5, "event": events, "paper": "", "case.IV.title": "{TITLE}"}}
run = gp.load("islanding").replace(short).run("IV")
report = run.report
""",
    "saved = (run.save('here') / 'report.txt').read_text()",
    "why = str(run.decision('inv4', 1.2))",
    "compared = str(gp.compare(run, run))",
    "predicted = str(gp.predict('islanding', 'IV'))",
    "import json; print(json.dumps([report, saved, why, compared, predicted]))",
)


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """The cells after they were executed in a kernel of their own."""
    folder = tmp_path_factory.mktemp("notebook")
    sources = [{"cell_type": "code", "id": f"c{i}", "metadata": {}, "source": text, "outputs": [],
                "execution_count": None} for i, text in enumerate(CELLS)]  # fmt: skip
    book = {"cells": sources, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}
    (folder / "texts.ipynb").write_text(json.dumps(book))
    done = subprocess.run([sys.executable, "-c", EXECUTE, "texts.ipynb"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    executed: list[Any] = json.loads((folder / "executed.ipynb").read_text())["cells"]
    return executed


def texts(cells: list[Any]) -> dict[str, str]:
    """What each cell's expression returned, by its variable."""
    printed = "".join(cells[-1]["outputs"][0]["text"])
    return dict(zip(("report", "saved", "why", "compared", "predicted"), json.loads(printed), strict=True))


def test_a_text_that_is_asked_for_is_returned_and_not_shown(cells: list[Any]) -> None:
    """The report, the file of it, an explanation, a comparison and a prediction; only the last cell prints."""
    got = texts(cells)

    assert [len(cell["outputs"]) for cell in cells] == [0, 0, 0, 0, 0, 1]
    assert "Frequency and power sharing after each event" in got["report"]
    assert got["saved"].startswith(got["report"].rstrip())
    assert got["why"].startswith("inv4 at t = 1.20 s")
    assert "The histories are the same, byte by byte." in got["compared"]
    assert "inv1" in got["predicted"] or "mode" in got["predicted"]
