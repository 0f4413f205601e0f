"""The record of runs in wall-clock time: what arrived when, what came of it, and what a dead process leaves behind."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.lab.explanation.explanation import explained
from gridpeers.lab.explanation.law_step import law_step
from gridpeers.lab.replay.recomputation import recomputed
from gridpeers.lab.trace import flows
from gridpeers.netem.models.delay import Normal
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.scenarios.results.record import Recorder
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.driver.session import Session
from gridpeers.wire.journal import ProcessEvent, RejectedCount, Token, WakeUp
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import LONGEST_MESSAGE, Ready, State, Telemetry
from tests.hostile.cases import sealed
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_runs import TOY


def recorded(
    folder: Path, plant: PlantConfig, agents: list[AgentConfig], watch: Callable[[Telemetry], None] | None = None
) -> RunRecord:
    """Run the toy in wall-clock time, and return its record; `watch` sees the telemetry as it comes."""
    info = RecordInfo(
        level=plant.record,
        scenario="toy",
        case="wall",
        toml="",
        seed=7,
        driver="processes",
        versions={},
        inverters=plant.agents,
        plant=plant,
        agents=tuple(agents),
    )
    with Recorder(folder / "wall", gaps=True, record=info) as recorder:

        def note(telemetry: Telemetry) -> None:
            if watch is not None:
                watch(telemetry)
            recorder(telemetry)

        outcome = run_processes(plant, agents, folder / "log", note, on_other=recorder, plant_command=TOY)
        assert outcome.broke == ""
        recorder.finish(recorder.ended, recorder.record_step)
    return RunRecord.open(folder / "wall")


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
    wall = {"clock": "wall", "links": links, "record": "all"}
    folder = tmp_path_factory.mktemp("wall")
    return recorded(folder, replace(plant, **wall), [replace(agent, **wall) for agent in agents])


def test_every_decision_can_be_made_again(record: RunRecord) -> None:
    """From what had arrived by then the same core decides the same to the byte; also around a pause and a restart."""
    assert record.complete
    for agent in record.agents:
        again = list(recomputed(record, agent))
        assert len(again) > 60
        assert [each.decision.tick for each in again if not each.agrees] == []
        assert sum(each.decision.restarted for each in again) >= 1


def test_a_decision_says_whom_it_left_out_and_why(record: RunRecord) -> None:
    """In a partition and in a pause the states of the others grow old; of a killed neighbour no more is known."""

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
    """Arrivals are in order on the receiver's clock, each with the message that its sender noted."""
    for agent in ("inv1", "inv2", "plant"):
        heard = [each for each in record.heard(agent) if each.kind in ("State", "Measurement")]
        assert len(heard) > 200
        times = [each.at for each in heard if each.at is not None]
        assert len(times) == len(heard)
        lacking = [each for each in heard if each.message is None]
        assert {each.sender for each in lacking} <= {"inv4"}, "the last of the killed one"
        assert all(each.t > 1.4 for each in lacking), "within its last second"
    fates = {outcome if isinstance(outcome, str) else "passed" for trace in record.links() for outcome in trace.outcome}
    assert fates >= {"passed", "loss", "partition"}


def test_a_journal_has_what_a_core_is_to_be_given_again(record: RunRecord) -> None:
    """Start, tokens and each time at which it was woken, in the order in which they came."""
    entries = list(record.entries("inv1"))
    first = entries[0]
    assert isinstance(first, ProcessEvent)
    assert first.kind == "start"
    assert sum(isinstance(entry, WakeUp) for entry in entries) > 100
    assert {entry.key.split("/")[1] for entry in entries if isinstance(entry, Token)} >= {"agent", "plant"}
    assert [entry.appeared for entry in entries if isinstance(entry, Token) and "inv4" in entry.key] == [True, False]


def test_decisions_alone_leave_arrivals_out(tmp_path: Path) -> None:
    """With "decisions" the inputs of each decision are there, and nothing of what else arrived."""
    plant, agents = toy_configs(3, end=0.6)
    wall = {"clock": "wall", "record": "decisions"}
    record = recorded(tmp_path, replace(plant, **wall), [replace(agent, **wall) for agent in agents])

    assert all(each.agrees for each in recomputed(record, "inv1"))
    assert sum(1 for _ in record.decisions("inv1")) > 15
    assert list(record.heard("inv1")) == []


def uses(decision: RecordedDecision, neighbour: str) -> bool:
    """Whether a law decided with the values of a neighbour, which a busy machine may hold up for too long."""
    return decision.action == "law" and neighbour in {each.name for each in decision.neighbours_used}


def test_each_step_adds_up(record: RunRecord) -> None:
    """Terms and limits of each decision of the law give the recorded step within 1e-12 pu."""
    for agent in record.agents:
        steps = [step for each in record.decisions(agent) if (step := law_step(record, each)) is not None]
        assert len(steps) > 20
        assert {step.problem for step in steps} == {""}
        assert max(max(abs(step.P_set.rest), abs(step.V_set.rest)) for step in steps) <= 1e-12


def test_a_stale_neighbour_is_told(record: RunRecord) -> None:
    """Once its last state is older than max_age it is left out, with what became of the later ones."""
    decision = next(each for each in record.decisions("inv2", since=0.9, until=1.08) if uses(each, "inv1"))

    of = {each.name: each for each in explained(record, decision, decision.t, record.events()).neighbours}

    assert of["inv3"].why.startswith("stale: older than max_age = 0.25 s; ")
    assert "cut off by a partition" in of["inv3"].why
    assert of["inv1"].used


def test_messages_take_their_time(record: RunRecord) -> None:
    """Each arrives after it was sent, and on an emulated link as many are lost as it has counted."""
    found = flows(record)

    assert all(flow.arrived >= flow.sent for flow in found if flow.arrived is not None)
    lost = [flow for flow in found if flow.is_lost and (flow.src, flow.dst, flow.fate) == ("inv1", "inv2", "loss")]
    assert len(lost) == record.link_counts()["inv1", "inv2"].dropped["loss"] > 10
    assert {flow.dst for flow in found} == {"plant", *record.agents}


def hostile(epoch: int) -> dict[str, bytes]:
    """Return what a foreigner publishes as states of inv1, whose epoch it has heard, by the kind of its rejection."""
    state = State(sender="inv1", epoch=epoch, seq=10**6, t=1.0, P_set=0.0, V_set=277.0, Q=0.0)
    return {
        "oversized": bytes(LONGEST_MESSAGE + 1),
        "corrupt": b"\xff" * 100,
        "garbled": sealed(b"\xc1"),
        "unknown": sealed(msgspec.msgpack.encode({"type": "Rumour", "sender": "inv1"})),
        "implausible": encode(replace(state, P_set=1e30)),
        "foreign": encode(replace(state, sender="inv3")),
        "ghost": encode(replace(state, epoch=epoch - 1)),
        "unexpected": encode(Ready(sender="inv1", epoch=epoch, seq=10**6, t=1.0)),
        "stale": encode(replace(state, seq=0, t=0.0)),
    }


class Foreigner:
    """Somebody who knows the endpoint, and publishes under the name of inv1; a callback for telemetry."""

    def __init__(self, endpoint: str) -> None:
        self._endpoint, self._session, self._key = endpoint, ExitStack(), Keys("toy").state("inv1")
        self._published: Session | None = None
        self._epoch = 1

    def __enter__(self) -> Foreigner:
        return self

    def __exit__(self, *_: object) -> None:
        self._session.close()

    def __call__(self, telemetry: Telemetry) -> None:
        """Publish everything once the losses have begun, again and again: the links of a session take their time."""
        if self._published is None:
            self._published = Session("foreigner", listen=("tcp/127.0.0.1:0",), connect=(self._endpoint,), clock="wall")
            self._session.callback(self._published.close)
            self._published.subscribe(self._key)
        elif telemetry.t >= 0.6 and not telemetry.final:
            for _, _, payload, _ in self._published.take(1, 0.0):
                self._epoch = decode(payload).epoch
            for payload in hostile(self._epoch).values():
                self._published.publish(self._key, payload)


def test_each_kind_of_rejected_message_is_told(tmp_path: Path) -> None:
    """Under a neighbour's name come messages of every kind, while its own are lost: all are counted, none is used."""
    endpoint = free_endpoint()
    netem = Netem(seed=7, links=(Fault(on="inv1 -> inv2", loss=1.0, from_s=0.4),))
    links = EmulationConfig(netem=netem, microgrids={f"inv{k}": "mg1" for k in (1, 2, 3)}).to_tree()
    plant, agents = toy_configs(3, end=4.0)
    wall = {"clock": "wall", "links": links, "record": "all"}
    with Foreigner(endpoint) as foreigner:
        found = recorded(
            tmp_path,
            replace(plant, listen=(endpoint,), **wall),
            [replace(agent, **wall) for agent in agents],
            foreigner,
        )

    rejected = {each.rejected for each in found.heard("inv2", since=0.0) if each.rejected}
    unread = {entry.kind for entry in found.entries("inv2") if isinstance(entry, RejectedCount)}
    assert rejected | unread == set(hostile(1))
    assert "oversized" in unread
    decision = next(each for each in found.decisions("inv2", since=3.6) if uses(each, "inv3"))
    explanation = explained(found, decision, decision.t, found.events())
    (told,) = [each.why for each in explanation.neighbours if each.name == "inv1"]
    assert "lost on the link" in told
    for kind in hostile(1):
        assert (f'rejected as "{kind}"' in told) == (kind != "stale"), kind  # no state since, but one from before
    assert all(step.problem == "" for each in found.decisions("inv2") if (step := law_step(found, each)) is not None)
    assert {each.name for each in explanation.decision.neighbours_used} == {"inv3"}
