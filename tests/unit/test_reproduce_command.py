"""The command `gridpeers reproduce`: one part from end to end, and what it says to slips."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scenarios.cli import app


def test_one_part_from_end_to_end(tmp_path: Path) -> None:
    """A report with its figures, every number of Table V within tolerance, exit code 0, and progress on the way."""
    out = tmp_path / "report"
    told = CliRunner().invoke(
        app, ["reproduce", "--driver", "inprocess", "--only", "microgrid-switching", "--out", str(out)]
    )

    assert told.exit_code == 0
    assert "microgrid-switching: 0 % done" in told.output
    assert "12 of 12 numbers of the tables within tolerance; 6 of 6 claims hold" in told.output
    assert {path.name for path in out.iterdir()} == {
        "report.html",
        "report.md",
        "metrics.json",
        "figures",
        "runs",
        "status.txt",
    }
    assert (out / "status.txt").read_text(encoding="utf-8") == "complete\n"
    assert {cell["within"] for cell in json.loads((out / "metrics.json").read_text(encoding="utf-8"))["tables"]} == {
        True
    }


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--only", "table"], '--only: no part "table"; did you mean "tables"?'),
        (["--driver", "threads"], '--driver: no driver "threads"; the drivers are processes, inprocess'),
        (["--out", __file__], "this is a file; give a new or an empty folder"),
    ],
)
def test_a_slip_is_told_before_anything_runs(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, and a sentence with what would be right."""
    ended = CliRunner().invoke(app, ["reproduce", *words])

    assert ended.exit_code == 2
    assert told in ended.output + capsys.readouterr().err
