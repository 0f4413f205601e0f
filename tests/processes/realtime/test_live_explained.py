"""Decisions and messages of runs in wall-clock time, explained from their record."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from netem.schema.fault import Fault
from netem.schema.netem import Netem
from scenarios.emulation.emulation_config import EmulationConfig
from scenarios.explanation.explanation import explained
from scenarios.explanation.law_step import law_step
from scenarios.record.record_reader import RunRecord
from scenarios.trace.flows import flows
from tests.processes.realtime.test_live_record import recorded
from tests.toy.toy_configs import toy_configs


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
    decision = next(each for each in record.decisions("inv2", since=0.9) if each.action == "law")

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
