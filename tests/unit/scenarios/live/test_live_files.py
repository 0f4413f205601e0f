"""The scenario of a live run that has ended."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import pytest

from gridpeers.agents.agent_config import MAX_AGE
from gridpeers.netem.fault_schedule import Heal, schedule_of
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.netem.schema.pattern import Link, links_among
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.emulation.link_data import LinkCommand
from gridpeers.scenarios.live import live_report
from gridpeers.scenarios.live.live_files import (
    LinkLog,
    check_new,
    ended_scenario,
    folders,
    replay_toml,
    write_scenario,
)
from gridpeers.scenarios.live.live_processes import ProcessOutcome
from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.scenarios.results.metrics_file import RunMetrics
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.schema import ScenarioModel, find_scenario, load_scenario
from gridpeers.scenarios.schema.participants import netem_of, setup_of
from gridpeers.wire.messages import PLANT, LinkRequest


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


def test_the_replayed_scenario_is_one_and_its_links_do_what_was_commanded(tmp_path: Path) -> None:
    """Written and read again, every link has at every time what scenario and commands gave it."""
    text = (
        "[time]\nend_s = 2.0\n[case.IV]\nsecondary = 'all'\ngraph = 'full'\n"
        "[[case.IV.link]]\non = 'MG1 -> MG2'\ndelay = 0.1\n[[partition]]\nalone = 'inv5'\nfrom_s = 1.0\nto_s = 1.5\n"
    )
    (tmp_path / "mine.toml").write_text(text)
    scenario, feeder = load_scenario(tmp_path / "mine.toml")
    setup = setup_of(netem_of(scenario, "IV"), scenario, feeder, real_nodes=True)
    changes = [
        LinkCommand(fault=Fault(on="* -> inv4", profile="lte", delay=0.3), for_s=1.0).at(0.62),
        LinkCommand(fault=Fault(on="inv4 <-> plant", cut=True)).at(1.2),
        LinkCommand(heal=Heal(on="inv1 -> inv4", from_s=0.0)).at(1.4),
        LinkCommand(fault=Fault(on="inv7 -> inv8", loss=0.5)).at(7.34),
    ]
    (tmp_path / "again.toml").write_text(replay_toml(scenario, feeder, changes, 7.33))
    again, _ = load_scenario(tmp_path / "again.toml")
    netem = netem_of(again, "IV")

    assert (again.name, again.time.end_s) == ("again", 7.36)
    assert again.cases["IV"].degraded_communication.max_age == MAX_AGE, "which only wall-clock time has by default"
    for link in links_among([name for name in setup.microgrids if name != "inv10"]):
        live = schedule_of(link, setup.netem, changes, setup.microgrids)
        planned = schedule_of(Link(*link), netem, (), setup.microgrids)
        for t in (0.0, 0.6, 0.62, 1.1, 1.3, 1.45, 1.6, 1.62, 7.32, 7.34, 7.5):
            was, is_now = ({k: s.model for k, s in one.at(t).active.items()} for one in (live, planned))
            gates = [{"cut" if kind == "partition" else kind for kind in found} for found in (was, is_now)]
            assert gates[0] == gates[1], (link, t)
            assert {k: m for k, m in was.items() if k in ("delay", "loss")} == {
                k: m for k, m in is_now.items() if k in ("delay", "loss")
            }


def a_log(folder: Path, *, record: bool = False) -> tuple[LinkLog, Path]:
    """Return the log of a run of islanding IV, and its file."""
    scenario, feeder = load_scenario(find_scenario("islanding"))
    scenario = msgspec.structs.replace(scenario, cases={"IV": scenario.cases["IV"]})
    file = folder / "replay.toml"
    replay, if_changed = (file, None) if record else (None, file)
    return LinkLog(scenario=scenario, feeder=feeder, replay=replay, replay_if_changed=if_changed), file


def cut(number: int) -> LinkRequest:
    """Return the command of a number: one cut of inv1 -> inv2, at its second."""
    tree = LinkCommand(fault=Fault(on="inv1 -> inv2", cut=True), for_s=0.5).to_tree()
    return LinkRequest(sender=PLANT, epoch=1, seq=number, t=float(number), link_command=tree, reply_to="")


def cuts_in(file: Path) -> int:
    """Return how many cuts a file has; a scenario is what it must be at any time."""
    return len(load_scenario(file)[0].netem.links)


def test_a_partition_by_islands_stays_one_and_another_becomes_cuts(tmp_path: Path) -> None:
    """Islands follow the switches, which the replay operates as the scenario does."""
    scenario, feeder = load_scenario(find_scenario("islanding"))
    by_island = Partition(by="island", from_s=1.0)
    scenario = msgspec.structs.replace(
        scenario,
        cases={"IV": scenario.cases["IV"]},
        netem=Netem(partitions=(by_island, Partition(by="halves", from_s=2.0, to_s=3.0))),
    )
    (tmp_path / "again.toml").write_text(replay_toml(scenario, feeder, (), 5.0))
    again = load_scenario(tmp_path / "again.toml")[0].netem

    assert again.partitions == (by_island,)
    assert {(entry.cut is not None, entry.from_s, entry.to_s) for entry in again.links} == {(True, 2.0, 3.0)}


def test_commands_are_written_at_once_and_from_the_twentieth_on_by_the_tenth(tmp_path: Path) -> None:
    """A run that is killed has all but a tenth of them in the file; the end writes the rest."""
    log, file = a_log(tmp_path)
    for number in (*range(1, 24), 22):
        log(cut(number))
    before = cuts_in(file)
    (line,) = log.close(24.0)

    assert (before, cuts_in(file)) == (22, 23)
    assert line.endswith("replay.toml")


@pytest.mark.parametrize(("record", "there"), [(True, True), (False, False)])
def test_without_a_command_only_a_file_that_was_asked_for_is_written(tmp_path: Path, record: bool, there: bool) -> None:
    """`--record FILE` is there after every run; a folder of results has a replay only of links that were changed."""
    log, file = a_log(tmp_path, record=record)
    lines = log.close(5.0)

    assert (file.exists(), bool(lines)) == (there, there)


def test_a_file_of_record_must_be_new(tmp_path: Path) -> None:
    """What another run has left is never overwritten."""
    file = tmp_path / "replay.toml"
    check_new(file)
    file.touch()

    with pytest.raises(UsageError, match=r"--record .*replay.toml: already exists; move it, or give another name"):
        check_new(file)
    with pytest.raises(UsageError, match="there is no folder"):
        check_new(tmp_path / "none" / "replay.toml")
