"""A run without messages is the run with messages: where they decide nothing, they may be left out."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig, Control, DegradedCommunication, GraphRule, LawChoice
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.inprocess import InprocessBus, messages_decide, run_inprocess
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import PlantEvent, Telemetry
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_plant import ToyPlant

Told = tuple[list[Telemetry], str, bool, tuple[PlantEvent, ...], tuple[str, ...], int]


def told(plant: PlantConfig, agents: tuple[AgentConfig, ...], *, messages: bool, toy: bool = True) -> Told:
    telemetry: list[Telemetry] = []
    given = ToyPlant(plant) if toy else None
    outcome = run_inprocess(plant, agents, telemetry.append, plant=given, messages=messages)
    return telemetry, outcome.broke, outcome.reproducible, outcome.events, outcome.notes, outcome.ticks


def both(control: Control, **changes: Any) -> Told:
    """Return what the toy's run tells, the same with messages and without."""
    plant, agents = toy_configs(7, control, end=0.6, **changes)
    assert not messages_decide(plant, agents)
    with_messages = told(plant, agents, messages=True)
    assert told(plant, agents, messages=False) == with_messages
    return with_messages


@pytest.fixture
def no_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(InprocessBus, "run")


@pytest.mark.parametrize("graph", ["full", "none", "GFM-only", "clustered", "ring"])
def test_every_graph_gives_the_same_telemetry(graph: GraphRule) -> None:
    """Neighbours are the same, and their states count from the same tick on."""
    assert both(Control(secondary="all", graph=graph))[1] == ""


@pytest.mark.parametrize("options", [
    DegradedCommunication(stale="skip"),
    DegradedCommunication(stale="age-weighted", T_age=0.05, weights="degree-normalised"),
    DegradedCommunication(max_age=0.03, anti_windup="conditional", T_sat=0.1),
    DegradedCommunication(islands="frequency"),
    DegradedCommunication(islands="ignored", anti_windup="none"),
])  # fmt: skip
def test_every_option_for_degraded_communication_gives_the_same_telemetry(options: DegradedCommunication) -> None:
    """Arrivals, ages, angles and saturation equal those with messages."""
    both(Control(secondary="all", graph="ring", degraded_communication=options))


def test_a_law_that_keeps_quiet_is_counted_and_its_last_state_stays() -> None:
    """Neighbours use the last sent state, and telemetry counts the quiet ones."""
    telemetry, *_ = both(Control(secondary="all", graph="ring", law=LawChoice(use="event-triggered")))

    assert sum(count for message in telemetry for _, count in message.quiet) > 20


@pytest.mark.parametrize("how", ["raises", "nothing"])
def test_a_law_that_fails_makes_its_agent_idle(how: str) -> None:
    """Its error is an event, its neighbours go on, and its inverter keeps its set-points."""
    law = LawChoice(use="tests.conformance.laws.bad_laws:Failing", parameters={"how": how})
    *_, events, _, ticks = both(Control(secondary=("inv2",), graph="full", law=law))

    assert [event.subject for event in events if event.kind == "law"] == ["inv2"]
    assert ticks == 30


def test_the_feeder_gives_the_same_telemetry() -> None:
    """Islanding, case IV: every message of telemetry is equal, and so is every byte of the history."""
    scenario, feeder = load_scenario("islanding")
    short = replace(scenario, events=(replace(scenario.events[0], t_s=0.2),), time=replace(scenario.time, end_s=0.6))
    plant, agents = configs(short, feeder, "IV")

    assert told(plant, agents, messages=False, toy=False) == told(plant, agents, messages=True, toy=False)


@pytest.mark.usefixtures("no_bus")
def test_a_run_in_which_messages_decide_nothing_has_none() -> None:
    """The run ends without the bus."""
    assert told(*toy_configs(3), messages=False)[1] == ""


@pytest.mark.parametrize("what", ["agent's links", "plant's links", "schedule", "newcomer"])
def test_messages_decide_where_one_may_miss_its_receiver(what: str) -> None:
    """Emulated links, and agents that join or leave, are for nodes."""
    plant, agents = toy_configs(3, schedule=((0.2, "inv2", "leave"),) if what == "schedule" else ())
    if what == "agent's links":
        agents = (agents[0], replace(agents[1], links={"seed": 1}), agents[2])
    elif what == "plant's links":
        plant = replace(plant, links={"seed": 1})
    elif what == "newcomer":
        plant = replace(plant, agents=plant.agents[:2])

    assert messages_decide(plant, agents)
