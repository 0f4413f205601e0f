"""The command line of sweeps: words, exit codes, and that what is wrong starts and writes nothing."""

from __future__ import annotations

import errno
import importlib.util
from functools import partial
from pathlib import Path

import pytest

from tests import command_line
from tests.unit.scenarios.sweep.conftest import Write

GRID = '[grid]\n"gains.k_p" = [0.0005, 0.0007]\n'


pytestmark = pytest.mark.usefixtures("elsewhere")

invoke = partial(command_line.invoke, "sweep")


def test_a_dry_run_tells_the_size_and_writes_nothing(sweep_file: Write, tmp_path: Path) -> None:
    sweep_file("[graph]\nlinks = [8, 36]\nper_count = 3\n" + GRID)

    assert invoke("mine.toml", "--dry-run") == (
        0,
        "mine.toml: 8 runs (8 samples of islanding) over gains.k_p, graph.links, graph.number, graph.lambda_2, "
        "graph.edges\n",
    )
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def test_a_bad_file_starts_and_writes_nothing(sweep_file: Write, tmp_path: Path) -> None:
    """Exit code 2 and every problem; a name that is no file has a suggestion."""
    sweep_file('[grid]\n"gains.alpa" = [1.0]\n"time.T_c_s" = [20]\n')

    code, text = invoke("mine.toml")

    assert code == 2
    assert text.startswith("gridpeers: 2 problems:\n")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]
    assert 'no sweep "topologi"; did you mean "topology"?' in invoke("topologi")[1]
    assert "no/such.toml: there is no such file; give the path of a sweep file" in invoke("no/such.toml")[1]


def test_what_is_missing_is_told_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra, the command names the package and the line that installs it."""
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "joblib" else find(name))

    assert invoke("topology", "--dry-run") == (
        2,
        "gridpeers: joblib is not installed, and needed for the runs over all cores; "
        "install it: pip install -e '.[sweep]'\n",
    )
    assert invoke("topologi")[1].startswith('gridpeers: no sweep "topologi"; '), "nothing to install for a wrong name"


def test_a_full_disk_ends_a_sweep_that_can_go_on(sweep_file: Write, tmp_path: Path) -> None:
    """Exit code 3, what could not be written and why, and which command goes on; then it does, once."""
    sweep_file(GRID)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.fsync", full)
        code, text = invoke("mine.toml", "--jobs", "1")

    folder = tmp_path / "runs" / "sweeps" / "mine"
    assert code == 3
    assert "gridpeers: runs/sweeps/mine: cannot be written: No space left on device\n" in text
    assert "of 2 runs are kept in runs/sweeps/mine/; continue with: gridpeers sweep mine.toml\n" in text
    assert (folder / "status.txt").read_text().startswith("broken: runs/sweeps/mine: cannot be written: No space left")
    first, again = invoke("mine.toml", "--jobs", "1"), invoke("mine.toml", "--jobs", "1")
    assert first[0] == again[0] == 0
    assert "mine.toml: 2 runs (2 samples of islanding) over gains.k_p; 2 are done already\n" in again[1]
    assert "2 runs reached their end\ntable: runs/sweeps/mine/results.csv\n" in again[1]
    assert (folder / "status.txt").read_text() == "complete\n"


def full(_: int) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")
