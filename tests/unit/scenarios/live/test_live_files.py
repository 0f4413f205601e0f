"""The scenario of a live run that has ended."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import pytest

from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.live import live_report
from gridpeers.scenarios.live.live_files import (
    ended_scenario,
    folders,
    write_scenario,
)
from gridpeers.scenarios.live.live_processes import ProcessOutcome
from gridpeers.scenarios.results.metrics_file import RunMetrics
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.schema import ScenarioModel, load_scenario


def islanding(**case: Any) -> ScenarioModel:
    """Case IV of islanding, which ends at 7 s, with some keys of the case changed."""
    scenario, _ = load_scenario(CATALOGUE / "islanding.toml")
    return msgspec.structs.replace(scenario, cases={"IV": msgspec.structs.replace(scenario.cases["IV"], **case)})


@pytest.mark.parametrize(
    ("ended", "end", "events"),
    [(0.5, 0.5, []), (2.01, 2.02, ["event1"]), (7.0, 7.0, ["event1", "event2"]), (60.0, 60.0, ["event1", "event2"])],
)
def test_the_folder_of_a_live_run_has_a_scenario_that_is_as_long(
    ended: float, end: float, events: list[str], tmp_path: Path
) -> None:
    """Whenever the run ended, its file can be run again for as long; its head names what it leaves out."""
    late = Netem(
        links=(Fault(on="* <-> *", delay=0.1, from_s=0.1), Fault(on="inv1 -> inv4", cut=True, from_s=6.0)),
        partitions=(Partition(by="halves", from_s=6.5, to_s=6.8),),
        nodes=(NodeFault(name="inv2", from_s=6.0, kill=True),),
    )
    scenario = islanding(netem=late, P_max_kW={"event2": {"inv2": 200.0}})
    with folders(tmp_path / "live", scenario) as kept:
        assert kept.whole == tmp_path / "live"
        write_scenario(kept.whole, *ended_scenario(scenario, ended))

    file = tmp_path / "live" / "scenario.toml"
    again, _ = load_scenario(file)  # which refuses what it could not run
    head = [line for line in file.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    assert again.time.end_s == end
    assert [event.label for event in again.events] == events
    assert f"It lasted {ended:.2f} s." in head[1]
    assert ("events that it did not reach" in " ".join(head).lower()) == (len(events) < 2)
    assert ("Faults of links and nodes that it did not reach" in " ".join(head)) == (end < 7.0)
    assert [len(entries) for entries in (again.cases["IV"].netem.links, again.cases["IV"].netem.nodes)] == (
        [1, 0] if end < 7.0 else [2, 1]
    )


def test_a_run_that_is_interrupted_while_it_is_judged_has_its_length_in_its_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its numbers may be missing, and its file can be run again for as long all the same."""

    def interrupted(*words: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(live_report, "write_report", interrupted)
    outcome = ProcessOutcome(recorded=cast(Recorded, SimpleNamespace(ended=2.01)))
    with folders(tmp_path / "live", islanding()) as kept:
        metrics = cast(RunMetrics, SimpleNamespace(scenario=islanding(), folder=kept.whole))
        ended = live_report.conclude(outcome, metrics)

    again, _ = load_scenario(tmp_path / "live" / "scenario.toml")
    assert again.time.end_s == 2.02
    assert ended.interrupted == "SIGINT"
