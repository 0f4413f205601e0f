"""The run of a soak with real processes, without record and report: its actions, and what it measures of them."""

from __future__ import annotations

import sys
from math import isinf
from pathlib import Path

import pytest

from bench.soak.soak_actions import SoakAction
from bench.soak.soak_run import SoakRun
from gridpeers.scenarios.schema import load_scenario


@pytest.mark.timeout(300)
@pytest.mark.skipif(sys.platform != "linux", reason="sizes of processes are from /proc")
def test_a_killed_agent_is_told_and_comes_back_and_a_cut_heals(tmp_path: Path) -> None:
    """Each time is measured, the sizes of plant, command and agents are there, no command fails, and the run ends."""
    feeder = load_scenario("islanding")[1]
    microgrids = {row.name: row.microgrid for row in feeder.inverters}
    with SoakRun(tmp_path, microgrids, "inv10", recorded=False) as run:
        run.disturb(SoakAction("kill", ("inv3",), 0.3))
        run.disturb(SoakAction("cut", ("inv4", "inv7"), 0.5))
        end = run.finish()

    assert {"told", "joined", "heal"} <= {timed.what for timed in run.times}
    assert [timed for timed in run.times if isinf(timed.seconds)] == []
    assert [name for name, _ in run.kills] == ["inv3"]
    assert {"plant", "command", *microgrids} == {size.name for size in run.sizes}
    last = {size.name: size for size in run.sizes}.values()  # an agent that has just been started is small
    assert [size for size in last if size.memory <= 5.0 or size.files <= 3] == []
    assert run.steps > 0
    assert (run.problems, end.status) == ([], 0)
