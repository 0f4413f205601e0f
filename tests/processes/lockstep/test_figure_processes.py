"""Figures that are drawn by several processes, as a command does after its last case."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest

from gridpeers.scenarios.drivers.forking import AVAILABLE, figure_server, release
from gridpeers.scenarios.results import figure_processes
from gridpeers.scenarios.results.figure_processes import drawn_on_all_cores, prepare_figures
from gridpeers.scenarios.results.plots import run_figures
from tests.processes.terminals import children_of
from tests.unit.scenarios.results.test_plots import drawing

pytestmark = pytest.mark.skipif(not AVAILABLE, reason="forks on Linux alone")


@pytest.fixture(autouse=True)
def two_cores(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine with two cores, and no server before or after."""
    monkeypatch.setattr(figure_processes, "_cores", lambda: 2)
    release()
    yield
    release()


def test_they_are_the_figures_of_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same files with the same bytes; this process draws none of them."""
    run_figures.draw_all(drawing("IV"), tmp_path / "one")
    monkeypatch.setattr(run_figures, "draw_all", lambda *_: pytest.fail("this process draws"))
    prepare_figures()

    with drawn_on_all_cores(drawing("IV"), tmp_path / "two"):
        pass

    one, two = ({file.name: file.read_bytes() for file in (tmp_path / name).iterdir()} for name in ("one", "two"))
    assert len(one) >= 8
    assert two == one


def test_what_goes_wrong_is_raised_here(tmp_path: Path) -> None:
    """A folder that cannot be written is the error of this process, and no process stays behind."""
    (tmp_path / "plots").write_text("a file")
    prepare_figures()
    before = children_of(os.getpid())
    assert before  # the server

    with pytest.raises(FileExistsError), drawn_on_all_cores(drawing("IV"), tmp_path / "plots"):
        pass

    assert children_of(os.getpid()) == before


def test_a_process_that_draws_ends_with_its_command(tmp_path: Path) -> None:
    """After a kill -9 of the command its folder may be another's: nothing comes into it any more."""
    server = figure_server()
    assert server is not None
    with (tmp_path / "log").open("wb") as log:
        process = server.fork([figure_processes.MODULE], log, speaks=False)

    process.stdin.write(pickle.dumps((drawing("IV"), tmp_path / "plots", 0, 1)))
    process.stdin.close()  # as the system does for a process that is killed

    assert process.wait() == 1
    assert not (tmp_path / "plots" / "overview.png").exists()  # the last of all
