"""A record has everything that a decision was made from: the same core decides the same from it, to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridpeers.agents.laws.consensus import Consensus
from gridpeers.lab.replay.recomputation import recomputed
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import Measurement, State
from tests.conformance.test_links import STORM
from tests.record.recorded_runs import recorded_run


def assert_decisions_are_recorded(record: RunRecord, *agents: str) -> None:
    """Each state of each agent, or of some, is one decision, which gives the same bytes when it is made again."""
    assert record.complete
    assert record.damage == ()
    for agent in agents or record.agents:
        states = [state.seq for state in record.messages(State, agent)]
        again = list(recomputed(record, agent))
        assert [each.decision.tick for each in again] == states
        assert [each.decision.tick for each in again if not each.agrees] == []


def test_islanding(tmp_path: Path) -> None:
    """Case IV of the paper's first scenario: 350 decisions of each of nine agents; another gain decides otherwise."""
    record = recorded_run("islanding", "IV", tmp_path / "IV")

    assert_decisions_are_recorded(record)
    again = list(recomputed(record, "inv4", Consensus(k_p=0.0008)))
    assert {each.decision.action for each in again if each.agrees} == {"hold"}
    assert not any(each.agrees for each in again if each.decision.t > 2.0)
    assert sum(1 for _ in record.messages(State)) == 9 * 350
    assert np.array_equal(
        record.physics().table, np.loadtxt(tmp_path / "IV" / "history.csv", delimiter=",", skiprows=1)
    )


def test_emulated_links_and_nodes(tmp_path: Path) -> None:
    """Delays, losses, copies, flipped bits, cuts, pauses, a kill, a slow clock: the record has all arrivals."""
    (tmp_path / "storm.toml").write_text(STORM, encoding="utf-8")
    record = recorded_run(tmp_path / "storm.toml", "storm", tmp_path / "storm")

    assert_decisions_are_recorded(record)
    ages = {each.age for d in record.decisions("inv1") for each in d.neighbours if each.age is not None}
    assert len(ages) > 10
    assert {each.unused for d in record.decisions("inv1") for each in d.neighbours} >= {"", "silent", "island"}
    rows = (tmp_path / "storm" / "links.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert sum(len(trace.seq) for trace in record.links()) == len([row for row in rows if "copy" not in row]) > 10_000


@pytest.mark.parametrize(("scenario", "case"), [
    ("partition", "halves-expire"),
    ("unheard-switches", "frequency"),
    ("reduced-communication", "reduced"),
    ("plug-n-play", "IV"),
])  # fmt: skip
def test_agents_with_a_memory(scenario: str, case: str, tmp_path: Path) -> None:
    """Ages, islands by frequency, quiet laws, and an agent that leaves and joins again."""
    assert_decisions_are_recorded(recorded_run(scenario, case, tmp_path / case), "inv1", "inv2", "inv5")


def test_every_driver_records_what_the_bus_carries(tmp_path: Path) -> None:
    """Each state and measurement, and each decision: with messages, without, and with processes."""
    bus = recorded_run("islanding", "III", tmp_path / "bus", messages=True)
    assert_decisions_are_recorded(bus, "inv4")
    for way in ("direct", "processes"):
        other = recorded_run("islanding", "III", tmp_path / way, processes=way == "processes")
        for kind in (Measurement, State):
            assert sorted(map(encode, other.messages(kind))) == sorted(map(encode, bus.messages(kind)))
        for agent in bus.agents:
            assert [(d.neighbours, d.before, d.action, d.state) for d in other.decisions(agent)] == [
                (d.neighbours, d.before, d.action, d.state) for d in bus.decisions(agent)
            ]
        assert other.events() == bus.events()


REJOIN = """
seed = 7
[time]
end_s = 0.8
[plant]
feeder = "microgrid123"
load_set = "main"
P_set0_pu = 0.647
[[event]]
label = "islanding"
t_s = 0.1
open = ["13-152"]
[[event]]
label = "leave"
t_s = 0.3
leave = ["inv2"]
[[event]]
label = "return"
t_s = 0.4
join = ["inv2"]
[[link]]
on = "inv1 -> inv3"
delay = 0.02
[case.case]
secondary = "all"
graph = "full"
law = "counting:Counting"
"""

COUNTING = """
import gridpeers as gp


class Counting(gp.Law):
    steps = 0

    def step(self, own, neighbours, T):
        self.steps += 1
        return gp.SetPoints(0.647 + 1e-4 * (self.steps % 17), 1.0)
"""


def test_each_process_of_an_agent_has_a_law_of_its_own(tmp_path: Path) -> None:
    """Also a law that keeps its memory at the start; decisions of the lost last part of the journal are left out."""
    (tmp_path / "rejoin.toml").write_text(REJOIN, encoding="utf-8")
    (tmp_path / "counting.py").write_text(COUNTING, encoding="utf-8")
    record = recorded_run(tmp_path / "rejoin.toml", "case", tmp_path / "case")

    again = list(recomputed(record, "inv2"))

    assert {each.decision.state.epoch for each in again if each.decision.action == "law"} == {1, 2}
    assert [each.decision.tick for each in again if not each.agrees] == []
