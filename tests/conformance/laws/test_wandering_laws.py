"""Laws and metrics that change the working folder of the process that they run in."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import pytest

import gridpeers as gp
from tests.conformance.laws.law_runs import SHORT


class Wanders(gp.Law):
    """Holds its set-points, somewhere else."""

    def step(self, own: gp.Own, neighbours: Sequence[gp.Neighbour], T: float) -> gp.SetPoints:
        """Hold."""
        os.chdir("/")
        return gp.SetPoints(own.P_set, own.V_set)


def test_the_run_is_written_where_it_was_to_be_and_read_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder is where it was when it was named."""
    monkeypatch.chdir(tmp_path)
    scenario = gp.load("islanding").replace({"case.IV.law": Wanders, **SHORT})
    written = scenario.run("IV", folder="here")

    assert Path.cwd() == Path("/")
    assert (tmp_path / "here" / "status.txt").read_text() == "complete\n"
    assert written.history.index[-1] == 1.5

    monkeypatch.chdir(tmp_path)
    read = gp.read("here")
    os.chdir("/")
    assert read.sha256 == written.sha256
