"""Runs with emulated links and agents, in one process and in many: the same histories, the same verdicts."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from gridpeers.netem.ledger import LinkCounts
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.results.link_record import LinkRecord
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from tests.toy.toy_runs import by_link

STORM = """
seed = 7
[time]
end_s = 4.0
[[event]]
label = "event1"
t_s = 1.0
open = ["13-152"]
[case.storm]
secondary = "all"
graph = "full"
[[link]]
on = "* <-> *"
delay = { model = "normal", mean_s = 0.05, std_s = 0.02, correlation = 0.5 }
loss = { model = "gilbert-elliott", p = 0.05, r = 0.4 }
duplicate = 0.05
corrupt = { p = 0.02, checksum = true }
[[link]]
on = "plant -> inv2"
delay = 0.03
loss = 0.1
[[link]]
on = "inv5 -> plant"
delay = { model = "uniform", low_s = 0.0, high_s = 0.05 }
[[link]]
on = "inv4 <-> inv7"
from_s = 1.5
to_s = 2.5
flap = { up_s = 0.3, down_s = 0.2 }
[[partition]]
by = "halves"
from_s = 2.0
to_s = 2.6
[[partition]]
by = "island"
from_s = 0.0
[[node]]
name = "inv3"
pause = true
from_s = 1.2
to_s = 1.8
[[node]]
name = "inv9"
kill = true
from_s = 3.0
[[node]]
name = "inv8"
slow_s = 0.03
from_s = 0.5
[[node]]
name = "inv6"
skew = { factor = 1.01 }
"""

CALM = STORM[: STORM.index("[[link]]")]


class Ran(NamedTuple):
    """Result of one run."""

    outcome: Outcome
    rows: list[tuple[float, ...]]
    links: LinkRecord


def run(path: Path, *, processes: bool) -> Ran:
    scenario, feeder = load_scenario(path)
    case = next(iter(scenario.cases))
    rows: list[tuple[float, ...]] = []
    links = LinkRecord()
    plant, agents = configs(scenario, feeder, case, "tcp/127.0.0.1:0" if processes else "")
    if processes:
        logs = path.parent / "log"
        outcome = run_processes(plant, agents, logs, lambda told: rows.extend(told.rows), on_other=links)  # type: ignore[arg-type]
    else:
        outcome = run_inprocess(plant, agents, lambda told: rows.extend(told.rows), on_other=links)  # type: ignore[arg-type]
    assert outcome.broke == ""
    return Ran(outcome, rows, links)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("storm")
    (made / "storm.toml").write_text(STORM)
    (made / "calm.toml").write_text(CALM)
    return made


@pytest.fixture(scope="module")
def storm(folder: Path) -> Ran:
    return run(folder / "storm.toml", processes=False)


def test_faults_act_alike_in_one_process_and_in_many(folder: Path, storm: Ran) -> None:
    """Histories and the hash of all verdicts agree, with every kind of fault on links and agents at once."""
    again = run(folder / "storm.toml", processes=True)

    assert again.rows == storm.rows
    assert again.links.sha256 == storm.links.sha256
    assert again.links.counts == storm.links.counts
    assert again.outcome.reproducible
    assert again.outcome.notes == ()


def test_every_link_has_an_account_that_closes(storm: Ran) -> None:
    """Sent plus copied equals delivered plus dropped plus pending on each link; faults of links show."""
    counts = storm.links.counts
    reasons = {reason for book in counts.values() for reason in book.dropped}

    assert len(counts) == 9 * 8 + 9 + 9 - _clear(counts)
    assert all(book.closes for book in counts.values())
    assert reasons == {"loss", "checksum", "flap", "partition"}


def _clear(counts: dict[tuple[str, str], LinkCounts]) -> int:
    """Links between plant and agents that nothing ever touches, whose messages are not even counted."""
    everybody = [f"inv{i}" for i in range(1, 10)]
    pairs = [(name, "plant") for name in everybody] + [("plant", name) for name in everybody]
    return sum(pair not in counts for pair in pairs)


def test_a_cut_elsewhere_changes_no_other_links_fate(folder: Path, storm: Ran) -> None:
    """Each link has its own random numbers: all other links keep the fate of each message."""
    (folder / "more.toml").write_text(STORM + '[[link]]\non = "inv1 -> inv4"\nfrom_s = 0.2\nto_s = 0.4\ncut = true\n')
    more = by_link(run(folder / "more.toml", processes=False).links)
    before = by_link(storm.links)

    assert {link for link in before if before[link].outcome != more[link].outcome} == {("inv1", "inv4")}


def test_a_paused_agent_holds_its_set_points_and_a_dead_ones_inverter_stays(storm: Ran) -> None:
    """The plant ignores states of a paused agent; after a death the last set-points stay."""
    P_set = {i: [(row[0], row[5 + 6 * (i - 1)]) for row in storm.rows] for i in (2, 3, 9)}
    paused = {value for t, value in P_set[3] if 1.3 <= t < 1.78}
    dead = {value for t, value in P_set[9] if t > 3.1}

    assert len(paused) == 1
    assert len({value for t, value in P_set[2] if 1.3 <= t < 1.78}) > 10
    assert len(dead) == 1
    assert [event.subject for event in storm.outcome.events if "dies" in event.text] == ["inv9"]
