"""The folder of a live run."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import pytest

from gridpeers.scenarios.live import live_report
from gridpeers.scenarios.live.live_files import folders
from gridpeers.scenarios.live.live_processes import ProcessOutcome
from gridpeers.scenarios.results.metrics_file import RunMetrics
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.schema import load_scenario


def test_a_run_that_is_interrupted_while_it_is_judged_has_its_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its numbers are missing; the scenario that it began with can be run again."""

    def interrupted(*words: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(live_report, "write_report", interrupted)
    scenario, _ = load_scenario("islanding")
    scenario = msgspec.structs.replace(scenario, cases={"IV": scenario.cases["IV"]})
    outcome = ProcessOutcome(recorded=cast(Recorded, SimpleNamespace(ended=2.01)))
    with folders(tmp_path / "live", scenario) as kept:
        assert kept.whole == tmp_path / "live"
        ended = live_report.conclude(outcome, cast(RunMetrics, SimpleNamespace(scenario=scenario, folder=kept.whole)))

    assert load_scenario(tmp_path / "live" / "scenario.toml")[0] == scenario
    assert ended.interrupted == "SIGINT"
    assert (tmp_path / "live" / "status.txt").read_text() == "broken: interrupted while its numbers were made\n"
