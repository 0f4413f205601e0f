"""The command `gridpeers experiment`, and what it draws and writes."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from gridpeers.papers.singhal2022.experiments import EXPERIMENTS
from gridpeers.papers.singhal2022.experiments.experiment_output import Curve, ExperimentResult, PlotPage, PlotPanel
from tests import command_line

DOCS = Path(__file__).parents[3] / "docs"

invoke = partial(command_line.invoke, "experiment")


def test_without_a_name_all_experiments_are_listed() -> None:
    """One line each, with its title."""
    code, text = invoke()

    assert code == 0
    assert [line.split()[0] for line in text.splitlines()] == list(EXPERIMENTS)


def test_an_unknown_name_gets_a_suggestion() -> None:
    """Exit code 2, and the nearest name."""
    assert invoke("dealy")[0] == 2
    assert 'no experiment "dealy"; did you mean "delay"?' in invoke("dealy")[1]


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    """Exit code 2, and nothing is written."""
    (tmp_path / "thesis.tex").write_text("mine")

    for name in ("delay", "partition"):
        code, text = invoke(name, "--out", str(tmp_path))
        assert code == 2
        assert str(tmp_path) in text
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_result_is_a_figure_and_the_same_table_twice(tmp_path: Path) -> None:
    """A time that is never reached is written as never and drawn at the edge."""
    x = np.array([0.0, 0.1, 1.0])
    curves = [Curve(x=x, y=np.array([1.0, 2.0, np.inf]), style=0), Curve(x=x, y=x + 1.0, style=1, look="predicted")]
    panel = PlotPanel(title="a", x_label="x (s)", y_label="y (s)", curves=curves, lines=[(0.5, 0)], log="xy", zero=0.02)
    rows = [{"x (s)": 0.0, "y (s)": 1.0}, {"x (s)": 1.0, "y (s)": np.inf}]

    ExperimentResult(PlotPage(title="t", panels=[panel], columns=1, names={0: "one"}), rows).write(tmp_path)

    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "table.csv").read_text() == "x (s),y (s)\n0.0,1.0\n1.0,never\n"
    assert (tmp_path / "table.md").read_text().splitlines()[-1] == "| 1 | never |"


def test_the_page_on_findings_has_the_command_and_the_figure_of_every_experiment() -> None:
    """There is no other figure beside them."""
    text = (DOCS / "understand" / "findings.md").read_text(encoding="utf-8")

    assert all(f"`gridpeers experiment {name}`" in text for name in EXPERIMENTS)
    assert all(f"images/experiments/{name}.png" in text for name in EXPERIMENTS)
    assert {path.stem for path in (DOCS / "images" / "experiments").iterdir()} == set(EXPERIMENTS)
