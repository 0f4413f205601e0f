"""The record of runs in real time: arrivals, decisions, and the record after a process died."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.lab.replay.recomputation import recomputed
from gridpeers.netem.models.delay import Normal
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.record import Recorder
from gridpeers.wire.journal import MessageReference, sender_of
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_runs import TOY


def recorded(folder: Path, plant: PlantConfig, agents: list[AgentConfig]) -> RunRecord:
    """Run the toy in real time, and return its record."""
    info = RecordInfo(
        level=plant.record,
        scenario="toy",
        case="realtime",
        toml="",
        seed=7,
        driver="processes",
        versions={},
        inverters=plant.agents,
        plant=plant,
        agents=tuple(agents),
    )
    with Recorder(folder / "realtime", gaps=True, record=info) as recorder:
        outcome = run_processes(plant, agents, folder / "log", recorder, on_other=recorder, plant_command=TOY)
        assert outcome.broke == ""
        recorder.finish()
    return RunRecord.open(folder / "realtime")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """Four agents for 3.4 s, with losses and delays, a partition, a pause, and a kill."""
    faults = (
        Fault(on="inv1 -> *", loss=0.2, delay=Normal(mean_s=0.05, std_s=0.02), duplicate=0.1),
        Fault(on="plant -> inv2", loss=0.1),
    )
    netem = Netem(
        seed=7,
        links=faults,
        partitions=(Partition(groups=(("inv1", "inv2"), ("inv3", "inv4")), from_s=0.5, to_s=1.1),),
        nodes=(NodeFault(name="inv3", pause=True, from_s=1.2, to_s=2.2), NodeFault(name="inv4", kill=True, from_s=2.4)),
    )
    microgrids = {f"inv{k}": "mg1" for k in (1, 2, 3, 4)}
    links = EmulationConfig(netem=netem, microgrids=microgrids, real_nodes=True).to_tree()
    plant, agents = toy_configs(4, end=3.4)
    realtime = {"clock": "realtime", "links": links, "record": "all"}
    folder = tmp_path_factory.mktemp("realtime")
    return recorded(folder, replace(plant, **realtime), [replace(agent, **realtime) for agent in agents])


def test_every_decision_can_be_made_again(record: RunRecord) -> None:
    """From the same arrivals the core makes the same decision, byte for byte, also around a pause and a restart."""
    assert record.complete
    for agent in record.agents:
        again = list(recomputed(record, agent))
        assert len(again) > 60
        assert [each.decision.tick for each in again if not each.agrees] == []
        assert sum(each.decision.restarted for each in again) >= 1


def test_a_decision_says_whom_it_left_out_and_why(record: RunRecord) -> None:
    """In a partition and in a pause the states of the others grow old. A killed neighbour has no state."""

    def reasons(agent: str, other: str, since: float, until: float) -> set[str]:
        return {
            each.unused
            for decision in record.decisions(agent, since=since, until=until)
            for each in decision.neighbours
            if each.name == other
        }

    assert reasons("inv2", "inv3", 0.85, 1.05) == {"stale"}
    assert "" in reasons("inv2", "inv1", 0.85, 1.05)
    times = [decision.t for decision in record.decisions("inv3", since=1.0, until=2.6)]
    asleep, awake = max(pairwise(times), key=lambda pair: pair[1] - pair[0])  # a busy machine may pause it late
    assert reasons("inv1", "inv3", asleep + 0.3, awake - 0.1) == {"stale"}
    known = ["inv4" not in decision.not_met for decision in record.decisions("inv1", since=2.3)]
    assert known[0]
    assert not known[-1]
    assert known == sorted(known, reverse=True), "once it is gone, it stays so"


def test_what_was_heard_is_there_with_its_time(record: RunRecord) -> None:
    """Each arrival has its time on the receiver's clock, and the message that its sender noted."""
    entries = [each for part in range(record.index.parts) for each in record.index.part(part).entries]
    heard = [(journal, entry) for journal, entry in entries if isinstance(entry, MessageReference)]
    for agent in ("inv1", "inv2"):
        assert sum(journal.sender == agent for journal, _ in heard) > 200
    assert all(entry.at is not None for _, entry in heard)
    lacking = [(journal, entry) for journal, entry in heard if record.index.named_by(entry, journal.t) is None]
    assert {sender_of(entry.key) for _, entry in lacking} <= {"inv4"}, "the last of the killed one"
    assert all(journal.t > 1.4 for journal, _ in lacking), "within its last second"
    fates = {outcome if isinstance(outcome, str) else "passed" for trace in record.links() for outcome in trace.outcome}
    assert fates >= {"passed", "loss", "partition"}
