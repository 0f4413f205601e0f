"""The plant under real time: steps, pace and commands."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gridpeers.plant.realtime.pacer import FIRST, RealTimePacer
from gridpeers.plant.realtime.realtime import LEAD
from gridpeers.plant.realtime.run_commands import COMMANDS
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.messages import Answer, Command, Measurement, Stop, Telemetry, Waiting
from tests.toy.toy_configs import toy_configs
from tests.unit.plant.plant_lab import KEYS
from tests.unit.plant.realtime.realtime_lab import T_C, Lab, running


def test_it_begins_when_all_are_there() -> None:
    """Step 0 is due a moment later, and goes to every agent, without a roster."""
    lab = running()
    assert lab.node.deadline == lab.now + LEAD
    lab.step()
    measurements: list[Measurement] = lab.take(Measurement)

    assert [(m.to, m.seq, m.t, m.roster) for m in measurements] == [(f"inv{i}", 0, 0.0, ()) for i in (1, 2, 3)]
    assert lab.node.deadline == pytest.approx(lab.now + T_C)


def test_it_waits_only_for_the_configured_time() -> None:
    """Then it begins without the missing agents, reports them, and admits them later."""
    lab = Lab(wait_for_agents=4.0)
    lab.join("inv1", "inv3")
    words = []
    while lab.node.phase == "gathering":
        lab.step()
        words.append([m.waits_for for m in lab.take(Waiting)])
    assert lab.now == pytest.approx(54.0)
    assert words == [[("inv2",)]] * 8 + [[]]
    lab.step()
    before = [m.to for m in lab.take(Measurement)]
    lab.join("inv2")
    lab.step()

    assert before == ["inv1", "inv3"]
    assert sorted(m.to for m in lab.take(Measurement)) == ["inv1", "inv2", "inv3"]
    assert lab.events("roster")[2].text.startswith("started without the agents of inv2, ")


def test_the_last_state_heard_is_held_from_the_next_step_on() -> None:
    """Only the newest state counts; an agent without a state keeps its set-points."""
    lab = running()
    lab.step()
    lab.state("inv1", 0, 60e3)
    lab.state("inv1", 1, 61e3)
    lab.state("inv1", 0, 62e3)
    assert lab.toy.measure()["inv1"].P_set == 50e3
    lab.step()

    readings = lab.toy.measure()
    assert [readings[name].P_set for name in lab.toy.inverters] == [61e3, 50e3, 50e3]
    assert lab.node.rejects.counts["stale"] == 1


def test_the_run_lasts_end_over_speed_and_stops_all_agents() -> None:
    """All rows exist; Stop goes to every agent; the run ends when they have left."""
    lab = running(speed=4.0)
    began = lab.now + LEAD
    lab.step(101)
    rows = [row for message in lab.take(Telemetry) for row in message.rows]

    assert lab.now - began == pytest.approx(0.5)
    assert [row[0] for row in rows] == pytest.approx([k * T_C for k in range(101)])
    assert [stop.reason for stop in lab.take(Stop)] == ["end of the scenario"]
    for name in ("inv1", "inv2", "inv3"):
        lab.token(name, gone=True)
    assert lab.node.finished
    assert lab.node.stepper.outcome == ""


def test_an_interrupted_plant_leaves_its_agents_to_the_next_one() -> None:
    """SIGTERM: the last telemetry goes out, but no Stop."""
    lab = running()
    lab.step()
    lab.node.interrupt("asked to leave: SIGTERM", 0.0)
    lab.do()

    assert lab.node.finished
    assert lab.take(Stop) == []
    assert lab.take(Telemetry)[-1].outcome == "asked to leave: SIGTERM"


def test_it_says_once_that_it_cannot_keep_pace() -> None:
    """More than 1 % of the steps over a control period late: a warning with the numbers; the run goes on."""
    lab = running()
    lab.step(10, delay=0.03)
    lab.step(10)
    warnings = lab.events("warning")

    assert lab.node.ticks.pacer.report().late == 10
    assert len(warnings) == 1
    assert warnings[0].text.startswith("cannot keep pace at speed 1: 2 of 2 steps (100.0 %) more than")


def test_strict_breaks_the_run_that_cannot_keep_pace() -> None:
    """The outcome has the reason, and the agents stop."""
    lab = running(strict=True)
    lab.step(2, delay=0.03)

    assert lab.node.stepper.outcome.startswith("plant: cannot keep pace at speed 1: ")
    assert len(lab.take(Stop)) == 1


def test_far_behind_it_delays_its_schedule_and_reports_the_delay() -> None:
    """Up to ten periods the schedule stays; a frozen plant does not rush through the missed steps."""
    lab = running()
    lab.step(3)
    due = lab.node.deadline
    lab.step(1, delay=0.15)
    assert lab.node.deadline == pytest.approx(due + T_C)
    lab.step(10)
    due = lab.node.deadline
    lab.step(1, delay=3.0)

    assert lab.node.deadline == pytest.approx(due + 3.0 + T_C)
    assert lab.events("warning")[-1].text.startswith("fell 3.000 s of real time behind")
    assert lab.node.ticks.pacer.report().slipped == pytest.approx(3.0)


def test_the_end_has_the_number_of_the_warnings_that_came_too_often() -> None:
    """Of seven slips five are events of their own; the last warning of the run counts the others."""
    lab = running()
    for _ in range(7):
        lab.step(1, delay=0.5)
    lab.node.close("the run was ended by command", lab.now)
    lab.do()
    slips = [event.text for event in lab.events("warning") if "behind" in event.text]

    assert len(slips) == 6
    assert slips[-1].startswith("2 more of this kind left out, the last: fell 0.500 s of real time behind")


def test_a_plant_without_solution_breaks_the_run() -> None:
    """Log and outcome have the cause, and the agents stop."""
    config, _ = toy_configs(3, end=2.0, P_set0=1.5)
    lab = running(settings=config.settings)
    lab.step(6)

    assert "no solution at t = 0.1 s" in lab.node.stepper.outcome
    assert lab.node.stepper.cause is not None
    assert len(lab.take(Stop)) == 1


def test_a_signal_in_the_middle_of_a_message_ends_the_process_and_not_the_message(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """SIGTERM comes at any moment: it is no error of the message that is just handled, which would be rejected."""
    lab = Lab(end=None)

    def connect(name: str, on: bool) -> None:
        raise StoppedError("SIGTERM")

    monkeypatch.setattr(lab.toy, "connect", connect)
    with pytest.raises(StoppedError):
        lab.join("inv1")


def test_pace_is_not_kept_if_more_than_one_percent_is_late() -> None:
    """Of the steps so far in a run without an end, after the first of them; it is news only once."""
    pacer = RealTimePacer(1.0, now=0.0)
    pacer.note(pacer.due + 2.0)
    assert not pacer.take_failure(of=None)
    for _ in range(FIRST - 2):
        pacer.note(pacer.due)
    assert not pacer.take_failure(of=None)
    pacer.note(pacer.due + 2.0)

    assert pacer.take_failure(of=None)
    assert not pacer.take_failure(of=None)


def test_commands_are_done_and_answered() -> None:
    """The plant operates switches, asks agents to leave, and answers the run's state as JSON."""
    lab = running()
    opened, again, stopped = lab.ask("open", "sw1"), lab.ask("open", "sw1"), lab.ask("stop", "inv2")
    lab.step()
    status = lab.ask("status").data

    assert opened.ok
    assert opened.text == "switch sw1: open at t = 0.00 s"
    assert (again.ok, again.text) == (True, "switch sw1 was open already at t = 0.00 s")
    assert stopped.ok
    assert [(stop.reason, stop.refused) for stop in lab.take(Stop)] == [("stopped by command", False)]
    assert (status["run"], status["phase"], status["tick"], status["pacing"]["late"]) == ("toy", "running", 1, 0)
    assert (status["agents"], status["absent"]) == (["inv1", "inv2", "inv3"], [])
    assert [event.text for event in lab.events("switch")] == ["sw1: open", "sw1: open"]


@pytest.mark.parametrize(("verb", "argument", "text"), [
    ("open", "sw7", 'no switch "sw7"; switches are sw1'),
    ("load", "load1", "load load1: nothing to set; give a factor, or real or reactive power"),
    ("stop", "inv7", 'no agent "inv7" is running; running are: inv1, inv2, inv3'),
])  # fmt: skip
def test_an_impossible_command_is_answered_with_the_choices(verb: str, argument: str, text: str) -> None:
    answer = running().ask(verb, argument)

    assert (answer.ok, answer.text) == (False, text)


def test_a_watcher_receives_an_event_at_once() -> None:
    """An event comes with the step in which it happens, not with the next telemetry; a flood of them waits for that."""
    lab = running()
    lab.step(2)
    lab.take(Telemetry)

    lab.ask("open", "sw1")
    lab.step()
    first = lab.take(Telemetry)
    lab.ask("close", "sw1")
    lab.step()

    assert [event.kind for message in first for event in message.events] == ["command", "switch"]
    assert lab.take(Telemetry) == []
    lab.step(10)
    assert "sw1: close" in [event.text for message in lab.take(Telemetry) for event in message.events]
    assert lab.ask("status").data["switches"] == {"sw1": True}


def test_a_flood_of_questions_gets_a_bounded_number_of_answers() -> None:
    """Of ten thousand questions between two steps the first are answered, the others counted; another verb is free."""
    lab = running(3)
    question = Command(sender="visitor", epoch=0, seq=0, t=0.0, verb="status", reply_to="z1")
    for number in range(10_000):
        lab.hear(KEYS.request, replace(question, seq=number))
    lab.do()
    answers = lab.take(Answer)
    end = lab.ask("down")
    lab.step(3)

    assert len(answers) == COMMANDS
    assert lab.node.rejects.counts["excess"] == 10_000 - COMMANDS
    assert end.ok
