"""Decisions and messages of runs in wall-clock time, explained from their record."""

from __future__ import annotations

from contextlib import ExitStack
from math import nan
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from gridpeers.lab.explanation.explanation import explained
from gridpeers.lab.explanation.law_step import law_step
from gridpeers.lab.trace.flows import flows
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.wire.bounds import LONGEST_MESSAGE
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.driver.session import Session
from gridpeers.wire.journal import RejectedCount
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Ready, State, Telemetry
from tests.hostile.cases import sealed
from tests.processes.realtime.test_live_record import recorded
from tests.toy.toy_configs import toy_configs


def uses(decision: RecordedDecision, neighbour: str) -> bool:
    """Whether a law decided with the values of a neighbour, which a busy machine may hold up for too long."""
    return decision.action == "law" and neighbour in {each.name for each in decision.neighbours_used}


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """Three agents for 1.2 s; what inverter 1 sends is lost from 0.4 s on."""
    netem = Netem(seed=7, links=(Fault(on="inv1 -> inv2", loss=1.0, from_s=0.4),))
    links = EmulationConfig(netem=netem, microgrids={f"inv{k}": "mg1" for k in (1, 2, 3)}).to_tree()
    plant, agents = toy_configs(3, end=1.2)
    wall = {"clock": "wall", "links": links, "record": "all"}
    folder = tmp_path_factory.mktemp("wall")
    return recorded(folder, replace(plant, **wall), [replace(agent, **wall) for agent in agents])


def test_each_step_adds_up(record: RunRecord) -> None:
    """Terms and limits of each decision of the law give the recorded step within 1e-12 pu."""
    for agent in record.agents:
        steps = [step for each in record.decisions(agent) if (step := law_step(record, each)) is not None]
        assert len(steps) > 20
        assert {step.problem for step in steps} == {""}
        assert max(max(abs(step.P_set.rest), abs(step.V_set.rest)) for step in steps) <= 1e-12


def test_a_stale_neighbour_is_told(record: RunRecord) -> None:
    """Once its last state is older than max_age it is left out, and the lost ones are counted."""
    decision = next(each for each in record.decisions("inv2", since=0.9) if uses(each, "inv3"))

    of = {each.name: each for each in explained(record, decision, decision.t).neighbours}

    assert of["inv1"].why.startswith("stale: older than max_age = 0.25 s; ")
    assert "lost on the link" in of["inv1"].why
    assert of["inv3"].used


def test_messages_take_their_time(record: RunRecord) -> None:
    """Each arrives after it was sent, and on the emulated link as many are lost as it has counted."""
    found = flows(record)

    assert all(flow.arrived >= flow.sent for flow in found if flow.arrived is not None)
    lost = [flow for flow in found if flow.is_lost]
    assert {(flow.src, flow.dst, flow.fate) for flow in lost} == {("inv1", "inv2", "loss")}
    assert len(lost) == record.link_counts()["inv1", "inv2"].dropped["loss"] > 20
    assert {flow.dst for flow in found} == {"plant", *record.agents}


def hostile(epoch: int) -> dict[str, bytes]:
    """Return what a foreigner publishes as states of inv1, whose epoch it has heard, by the kind of its rejection."""
    state = State(sender="inv1", epoch=epoch, seq=10**6, t=1.0, P_set=0.0, V_set=277.0, Q=0.0)
    return {
        "oversized": bytes(LONGEST_MESSAGE + 1),
        "corrupt": b"\xff" * 100,
        "garbled": sealed(b"\xc1"),
        "unknown": sealed(msgspec.msgpack.encode({"type": "Rumour", "sender": "inv1"})),
        "not finite": encode(replace(state, P_set=nan)),
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
    explanation = explained(found, decision, decision.t)
    (told,) = [each.why for each in explanation.neighbours if each.name == "inv1"]
    assert "lost on the link" in told
    for kind in hostile(1):
        assert (f'rejected as "{kind}"' in told) == (kind != "stale"), kind  # no state since, but one from before
    assert all(step.problem == "" for each in found.decisions("inv2") if (step := law_step(found, each)) is not None)
    assert {each.name for each in explanation.decision.neighbours_used} == {"inv3"}
