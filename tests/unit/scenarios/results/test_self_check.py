"""The option `--self-check` of `gridpeers run`, and what an ordinary run does without it."""

import json
import subprocess
import sys
from pathlib import Path

from tests.processes.commands.test_run_command import command

LOSSY = """
[time]
end_s = 1.5
[case.lossy]
secondary = "all"
graph = "ring"
[[link]]
on = "inv1 <-> inv2"
loss = 0.2
delay = 0.02
"""


def ran(folder: Path, *options: str) -> tuple[str, dict[str, object]]:
    """Run the scenario; return its report and links.json."""
    (folder / "lossy.toml").write_text(LOSSY)
    words = command("run", "lossy.toml", "--driver", "inprocess", "--out", "here", *options)
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return (folder / "here" / "report.txt").read_text(), json.loads(
        (folder / "here" / "lossy" / "links.json").read_text()
    )


def test_the_self_check_is_made_when_it_is_asked_for(tmp_path: Path) -> None:
    """The report has the number of tests and of those that failed; links.json has each test."""
    report, links = ran(tmp_path, "--self-check")

    assert "self-check: 4 tests, none failed" in report
    tests = links["tests"]
    assert isinstance(tests, list)
    assert {(test["what"], test["ok"]) for test in tests} == {("loss", True), ("delay", True)}


def test_a_run_without_the_option_says_and_imports_nothing_of_it(tmp_path: Path) -> None:
    """Neither report nor links.json mentions a test, and scipy.stats, which takes half a second, is not imported."""
    (tmp_path / "lossy.toml").write_text(LOSSY)
    code = (
        "import sys, gridpeers as gp; gp.load('lossy.toml').run('lossy', folder='here');"
        "print('scipy.stats' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=100)

    assert done.stdout == "False\n", done.stderr
    assert "self-check" not in (tmp_path / "here" / "report.txt").read_text()
    links = json.loads((tmp_path / "here" / "lossy" / "links.json").read_text())
    assert links.keys() == {"trace_sha256", "accounts"}
