"""The command `gridpeers reproduce`: one part from end to end, and what it says to slips."""

import json
from pathlib import Path

import pytest

from tests.command_line import invoke


def test_one_part_from_end_to_end(tmp_path: Path) -> None:
    """A report with its figures, every number of Table V within tolerance, exit code 0, and lines of progress."""
    out = tmp_path / "report"
    code, text = invoke("reproduce", "--driver", "inprocess", "--only", "microgrid-switching", "--out", str(out))

    assert code == 0
    assert "microgrid-switching, case IV: 0 % done\n" in text
    assert "12 of 12 numbers of Table V are within their tolerance." in text
    assert "V_error: 0 of 3 numbers within 25 %" in text
    assert "6 of 7 claims hold, 1 known deviation, 0 failed." in text
    assert {path.name for path in out.iterdir()} == {
        "report.html",
        "report.md",
        "metrics.json",
        "figures",
        "runs",
        "status.txt",
    }
    assert {path.name for path in (out / "figures").iterdir()} == {
        f"switching.{kind}" for kind in ("png", "pdf", "svg")
    }
    assert (out / "status.txt").read_text(encoding="utf-8") == "complete\n"
    assert {cell["within"] for cell in json.loads((out / "metrics.json").read_text(encoding="utf-8"))["tables"]} == {
        True
    }


@pytest.mark.parametrize(("words", "told"), [
    (["--only", "table"], '--only: no part "table"; did you mean "tables"?'),
    (["--out", __file__], "this is a file; give a new or an empty folder"),
])  # fmt: skip
def test_a_wrong_option_is_refused_before_any_run(words: list[str], told: str) -> None:
    """Exit code 2, and a sentence with the right choice."""
    code, text = invoke("reproduce", *words)

    assert code == 2
    assert told in text
