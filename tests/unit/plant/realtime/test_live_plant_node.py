"""The agents of a plant in real time: those that come, return, leave or die, and those that are refused."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.plant.meeting import REFUSALS
from gridpeers.plant.plant_config import ScheduledAction
from gridpeers.wire.messages import Measurement, Stop, Telemetry
from gridpeers.wire.node import Log
from tests.toy.toy_configs import agent_config
from tests.unit.plant.plant_lab import KEYS
from tests.unit.plant.realtime.realtime_lab import Lab, running


def test_a_leaving_agent_disconnects_its_inverter_and_a_returning_one_connects_it() -> None:
    """The vanished token of an agent that left is no death; its successor counts from 0."""
    lab = running()
    lab.state("inv2", 40, 60e3)
    lab.leave("inv2")
    lab.token("inv2", gone=True)
    lab.step()
    away = lab.toy.measure()["inv2"].P
    assert [m.to for m in lab.take(Measurement)] == ["inv1", "inv3"]
    lab.join("inv2", instance="b", epoch=2)
    lab.state("inv2", 0, 55e3, epoch=2)
    lab.step()

    assert away == 0.0
    back = lab.toy.measure()["inv2"]
    assert back.P_set == pytest.approx(55e3)
    texts = [event.text for event in lab.events("roster")]
    assert [text.split(",")[0].split(";")[0] for text in texts[3:]] == ["inv2 left", "inv2 joined"]


def test_the_inverter_of_an_agent_that_died_stays_on_primary_droop() -> None:
    """Its inverter is not switched, and keeps the set-points; the run goes on."""
    lab = running()
    lab.state("inv2", 0, 60e3)
    lab.step()
    lab.token("inv2", gone=True)
    lab.step()

    held = lab.toy.measure()["inv2"].P
    assert held == pytest.approx(60e3)
    assert lab.node.phase == "running"
    assert "inv2 died; its inverter stays on primary droop" in lab.events("roster")[-1].text


def test_a_spare_inverter_comes_on_line_with_its_agent() -> None:
    """The start does not wait for it, and other inverters do not change."""
    lab = running(4, spares=("inv4",))
    lab.step()
    assert lab.toy.measure()["inv4"].P == 0.0
    lab.join("inv4")
    lab.step()

    on_line = lab.toy.measure()["inv4"].P
    assert on_line == pytest.approx(50e3)
    assert [event.text for event in lab.events("inverter")] == ["inv4 connected"]


def test_a_second_agent_of_a_name_and_one_of_no_inverter_are_refused() -> None:
    """By name; the first agent continues, and messages of the second are ignored."""
    lab = running()
    lab.token("inv2", "b")
    lab.token("inv9", "c")
    lab.leave("inv2", epoch=9)
    lab.step()
    keys = [key for key, message in lab.sent if isinstance(message, Stop)]
    stops: list[Stop] = lab.take(Stop)

    assert keys == [KEYS.stop_request("inv2", "b"), KEYS.stop_request("inv9", "c")]
    assert all(stop.refused for stop in stops)
    assert stops[0].reason.startswith("inv2: another agent of this name takes part in run toy already")
    assert stops[1].reason == "inv9: no inverter of this name; inverters are inv1, inv2, inv3"
    assert len(lab.take(Measurement)) == 3
    assert lab.node.rejects.counts["ghost"] == 1


def test_the_scenario_asks_agents_to_leave_and_awaits_those_that_join() -> None:
    """At its tick only the leaving agent is stopped, and off when it answers; telemetry names the awaited one."""
    schedule = (
        ScheduledAction(t=0.1, inverter="inv2", action="leave"),
        ScheduledAction(t=0.2, inverter="inv2", action="join"),
    )
    lab = running(3, schedule=schedule)
    lab.step(6)
    stops = [(key, message.refused) for key, message in lab.sent if isinstance(message, Stop)]
    lab.leave("inv2")
    lab.token("inv2", gone=True)
    off = lab.toy.measure()["inv2"].P
    lab.step(6)
    awaited = [(m.t, m.awaited) for m in lab.take(Telemetry) if m.awaited]
    lab.join("inv2", instance="b", epoch=2)

    assert stops == [(KEYS.stop_request("inv2", "inv2"), False)]
    assert off == 0.0
    assert awaited == [(0.2, ("inv2",))]
    assert lab.toy.measure()["inv2"].P != 0.0


def test_a_nameplate_that_does_not_come_is_asked_for_again() -> None:
    """A question can die with the link it went over, though the agent's token stays; the answer ends the asking."""
    lab = running(2)
    lab.token("inv2", gone=True)
    lab.token("inv2", "b")
    lab.step(60)
    asked = lab.fetched.count(("inv2", "b"))
    lab.hear(KEYS.nameplate("inv2", "b"), replace(Agent(agent_config("inv2")).nameplate, epoch=2))
    lab.step(60)

    assert asked == 2
    assert lab.fetched.count(("inv2", "b")) == 2
    assert [m.to for m in lab.take(Measurement)][-1] == "inv2"


def test_an_agent_that_comes_while_the_run_ends_receives_the_end() -> None:
    """An agent whose session was renewed just then has not heard the end; else it would seek a plant for minutes."""
    lab = Lab()
    lab.join("inv1", "inv2", "inv3")
    lab.node.abort("the end of it", lab.now)
    lab.do()
    lab.token("inv2", gone=True)
    lab.sent.clear()
    lab.token("inv2", "b")

    ((key, stop),) = lab.sent
    assert key == KEYS.stop_request("inv2", "b")
    assert isinstance(stop, Stop)
    assert stop.reason == "the end of it"
    assert not stop.refused


def test_of_thousands_of_refused_agents_some_get_an_answer() -> None:
    """Any process may hold a token: the first get answers, then ten a second; the log has one line for each kind."""
    lab = running(3)
    lab.take(Stop)
    for i in range(5_000):
        lab.node.appeared(KEYS.alive_agent("inv2", f"x{i}"), lab.now)
        lab.node.appeared(KEYS.alive_agent(f"who{i}", "x"), lab.now)
    logged = [action.text for action in lab.node.post.actions if isinstance(action, Log)]
    lab.do()
    told = lab.take(Stop)
    lab.now += 1.0
    lab.node.appeared(KEYS.alive_agent("inv2", "y"), lab.now)
    lab.do()

    assert len(told) == REFUSALS
    assert [line.split(": ")[1] for line in logged] == ["refused inv2", "refused who0"]
    assert all(stop.refused for stop in told)
    assert lab.node.rejects.counts["excess"] == 10_000 - REFUSALS
    assert len(lab.take(Stop)) == 1
