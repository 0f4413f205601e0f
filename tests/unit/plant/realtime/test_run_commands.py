"""Commands to a plant in real time: done, refused, and answered a bounded number of times."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gridpeers.plant.realtime.realtime_plant import COMMANDS
from gridpeers.wire.messages import Answer, Command, LoadSetting, Stop, Telemetry
from tests.unit.plant.realtime.realtime_lab import KEYS, running


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


def test_a_load_is_set_and_a_status_has_it() -> None:
    """The answer says the power; the status has it until the run ends."""
    lab = running()
    set_ = lab.ask("load", "load1", load=LoadSetting(P=2e3, Q=-1e3))
    wrong = lab.ask("load", "load7", load=LoadSetting(factor=0.5))

    assert (set_.ok, set_.text) == (True, "load1: 2000-1000j VA, at t = 0.00 s")
    assert (wrong.ok, wrong.text) == (False, 'no load "load7"; loads are load1')
    assert lab.ask("status").data["loads"] == {"load1": [2e3, -1e3]}


@pytest.mark.parametrize(("verb", "argument", "text"), [
    ("open", "sw7", 'no switch "sw7"; switches are sw1'),
    ("load", "load1", "load load1: nothing is to be set; give a factor, or real or reactive power"),
    ("stop", "inv7", 'no agent "inv7" is running; running are: inv1, inv2, inv3'),
])  # fmt: skip
def test_what_cannot_be_done_is_answered_with_what_there_is(verb: str, argument: str, text: str) -> None:
    """The answer is not ok, and names the choices."""
    answer = running().ask(verb, argument)

    assert (answer.ok, answer.text) == (False, text)


def test_who_watches_hears_of_an_event_at_once() -> None:
    """An event comes with the step in which it happens, not with the next telemetry; a flood of them waits for that."""
    lab = running()
    lab.step(2)
    lab.take(Telemetry)

    lab.ask("open", "sw1")
    lab.step()
    first = lab.take(Telemetry)
    lab.ask("close", "sw1")
    lab.step()

    assert [event.text for message in first for event in message.events] == ["sw1: open"]
    assert lab.take(Telemetry) == []
    lab.step(10)
    assert "sw1: close" in [event.text for message in lab.take(Telemetry) for event in message.events]
    assert lab.ask("status").data["switches"] == {"sw1": True}


def test_a_run_is_ended_once() -> None:
    """A second order to end a run that ends already is refused, and does not end it anew."""
    lab = running()
    lab.step()
    answers = [lab.ask("down"), lab.ask("down")]

    assert [(answer.ok, answer.text) for answer in answers][1] == (False, "the run is ending")
    assert answers[0].ok
    assert [message.final for message in lab.take(Telemetry)].count(True) == 1


def test_who_asks_without_end_is_answered_a_bounded_number_of_times() -> None:
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
    assert lab.side.rejects.counts["excess"] == 10_000 - COMMANDS
    assert end.ok
