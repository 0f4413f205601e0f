"""The course of a run in real time, on a fake clock: its start, its pace, its end, and recorders that it waits for."""

from __future__ import annotations

import pytest

from gridpeers.plant.plant_node import MOST_RECORDERS
from gridpeers.plant.realtime.realtime_plant import LEAD
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.messages import Measurement, Stop, Telemetry, Waiting
from tests.toy.toy_configs import toy_configs
from tests.unit.plant.realtime.realtime_lab import KEYS, T_C, Lab, running


def test_it_begins_when_all_are_there() -> None:
    """Step 0 is due a moment later, and goes to every agent, without a roster."""
    lab = running()
    assert lab.side.deadline == lab.now + LEAD
    lab.step()
    measurements: list[Measurement] = lab.take(Measurement)

    assert [(m.to, m.seq, m.t, m.roster) for m in measurements] == [(f"inv{i}", 0, 0.0, ()) for i in (1, 2, 3)]
    assert lab.side.deadline == pytest.approx(lab.now + T_C)


def test_it_waits_only_as_long_as_told() -> None:
    """Then it begins without who is missing, says so, and takes them in when they come; till then it says it waits."""
    lab = Lab(wait_for_agents=4.0)
    lab.join("inv1", "inv3")
    words = []
    while lab.side.phase == "gathering":
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


def test_a_recorder_is_awaited_too() -> None:
    """Else its first rows would be missing."""
    lab = Lab(recorders=("fleet",))
    lab.join("inv1", "inv2", "inv3")
    assert lab.side.phase == "gathering"
    lab.side.appeared(KEYS.alive_recorder("fleet"), lab.now)

    assert lab.side.phase == "running"


def test_the_last_state_heard_is_held_from_the_next_step_on() -> None:
    """Of several only the newest counts; who says nothing keeps its set-points."""
    lab = running()
    lab.step()
    lab.state("inv1", 0, 60e3)
    lab.state("inv1", 1, 61e3)
    lab.state("inv1", 0, 62e3)
    assert lab.toy.measure()["inv1"].P_set == 50e3
    lab.step()

    readings = lab.toy.measure()
    assert [readings[name].P_set for name in lab.toy.inverters] == [61e3, 50e3, 50e3]
    assert lab.side.rejects.counts["stale"] == 1


def test_the_run_lasts_end_over_speed_and_all_are_told() -> None:
    """All rows are there; Stop goes to everybody; it is over once they have gone."""
    lab = running(speed=4.0)
    began = lab.now + LEAD
    lab.step(101)
    rows = [row for message in lab.take(Telemetry) for row in message.rows]

    assert lab.now - began == pytest.approx(0.5)
    assert [row[0] for row in rows] == pytest.approx([k * T_C for k in range(101)])
    assert [stop.reason for stop in lab.take(Stop)] == ["end of the scenario"]
    for name in ("inv1", "inv2", "inv3"):
        lab.token(name, gone=True)
    assert lab.side.finished
    assert lab.side.outcome == ""


def test_a_plant_that_stays_has_no_end() -> None:
    """With end None it goes on until somebody ends it."""
    lab = running(end=None)
    lab.step(400)
    answer = lab.ask("down")

    assert answer.ok
    assert lab.take(Stop)[0].reason == "the run was ended by command"
    assert lab.side.phase == "closing"


def test_an_interrupted_plant_leaves_its_agents_to_the_next_one() -> None:
    """SIGTERM: the last telemetry goes out, but no Stop."""
    lab = running()
    lab.step()
    lab.side.interrupt("asked to leave: SIGTERM", 0.0)
    lab.do()

    assert lab.side.finished
    assert lab.take(Stop) == []
    assert lab.take(Telemetry)[-1].outcome == "asked to leave: SIGTERM"


def test_it_says_once_that_it_cannot_keep_pace() -> None:
    """More than 1 % of the steps over a control period late: a warning with the numbers; the run goes on."""
    lab = running()
    lab.step(10, delay=0.03)
    lab.step(10)
    warnings = lab.events("warning")

    assert lab.side.pacer.report().late == 10
    assert len(warnings) == 1
    assert warnings[0].text.startswith("cannot keep pace at speed 1: 2 of 2 steps (100.0 %) more than")


def test_strict_breaks_the_run_that_cannot_keep_pace() -> None:
    """The outcome says why; agents are told."""
    lab = running(strict=True)
    lab.step(2, delay=0.03)

    assert lab.side.outcome.startswith("plant: cannot keep pace at speed 1: ")
    assert len(lab.take(Stop)) == 1


def test_far_behind_it_puts_its_schedule_off_and_says_how_much() -> None:
    """A frozen plant does not rush through what it has missed; telemetry tells the slip."""
    lab = running()
    lab.step(3)
    due = lab.side.deadline
    lab.step(1, delay=3.0)

    assert lab.side.deadline == pytest.approx(due + 3.0 + T_C)
    assert lab.events("warning")[0].text.startswith("fell 3.000 s of wall time behind")
    assert lab.side.pacer.report().slipped == pytest.approx(3.0)


def test_a_plant_without_solution_breaks_the_run() -> None:
    """The cause is kept for the log, the outcome says it, agents are told."""
    config, _ = toy_configs(3, end=2.0, P_set0=1.5)
    lab = running(settings=config.settings)
    lab.step(6)

    assert "no solution at t = 0.1 s" in lab.side.outcome
    assert lab.side.cause is not None
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


def test_an_ended_run_stays_for_a_recorder_that_stood_still() -> None:
    """One that comes back five seconds after the end still gets all of it, the last telemetry too."""
    lab = Lab(recorders=("r",))
    recorder = KEYS.alive_recorder("r")
    lab.side.appeared(recorder, lab.now)
    lab.join("inv1", "inv2", "inv3")
    lab.step(10)
    lab.side.vanished(recorder, lab.now)
    lab.ask("down")
    for name in ("inv1", "inv2", "inv3"):
        lab.token(name, gone=True)
    lab.take(Telemetry)
    lab.now += 5.0
    lab.side.expire(lab.now)
    lab.side.appeared(recorder, lab.now)
    lab.do()
    assert lab.side.phase == "closing"

    lab.ask("telemetry", "0")
    again = lab.take(Telemetry)
    lab.side.vanished(recorder, lab.now)

    assert [message.seq for message in again] == list(range(len(again)))
    assert again[-1].final
    assert lab.side.finished


def test_an_ended_run_does_not_stay_for_ever() -> None:
    """A recorder that never comes back, and an agent that never leaves, keep nothing."""
    lab = Lab(recorders=("r",))
    lab.side.appeared(KEYS.alive_recorder("r"), lab.now)
    lab.join("inv1", "inv2", "inv3")
    lab.step(10)
    ended = lab.now
    lab.ask("down")
    while not lab.side.finished:
        lab.step()

    assert lab.now - ended < 15.1


def test_of_thousands_of_recorders_some_are_noted_and_the_needed_one_always() -> None:
    """The run begins with the recorder that it waits for, whoever else claims to be one; the others are counted."""
    lab = Lab(recorders=("r",))
    lab.join("inv1", "inv2", "inv3")
    for i in range(1_000):
        lab.side.appeared(KEYS.alive_recorder(f"r{i}"), lab.now)
    assert lab.side.phase == "gathering"
    lab.side.appeared(KEYS.alive_recorder("r"), lab.now)

    assert lab.side.phase == "running"
    assert lab.side.rejects.counts == {"excess": 1_000 - MOST_RECORDERS}
