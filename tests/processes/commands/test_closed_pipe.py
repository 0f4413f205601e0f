"""Output into a pipe that nobody reads any more, as of `gridpeers list | head -1`: a real one, closed at one end."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes.commands.test_run_command import command
from tests.processes.terminals import DEADLINE


@pytest.fixture
def closed_pipe() -> Iterator[int]:
    """The end to write to of a pipe without reader."""
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


@pytest.mark.parametrize(
    "words",
    [["list"], ["run", "calm.toml", "--driver", "inprocess", "--out", "here"]],
    ids=lambda words: words[0],
)
def test_a_command_that_nobody_reads_ends_without_a_word(words: list[str], closed_pipe: int, tmp_path: Path) -> None:
    """Exit status 141, as of a command that SIGPIPE has ended; a run's folder says why it is not whole."""
    (tmp_path / "calm.toml").write_text('[time]\nend_s = 0.1\n[case.calm]\nsecondary = "all"\ngraph = "ring"\n')
    done = subprocess.run(
        command(*words), cwd=tmp_path, stdout=closed_pipe, stderr=subprocess.PIPE, text=True, timeout=DEADLINE
    )

    assert (done.returncode, done.stderr) == (141, "")
    if words[0] == "run":
        assert (tmp_path / "here" / "status.txt").read_text() == "broken: nobody reads its output any more\n"
