from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from agents.agent import Agent
from plant.plant_config import ScheduledAction
from plant.plant_node import MOST_RECORDERS
from plant.realtime.live_plant_node import REFUSAL_INTERVAL, REFUSALS
from plant.realtime.realtime_plant import COMMANDS, LEAD, RealtimePlant
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant
from wire.actions import Fetch, Publish
from wire.codec import decode, encode
from wire.driver.drive import StoppedError
from wire.keys import Keys
from wire.messages import (
    Answer,
    Command,
    Leave,
    LoadSetting,
    Measurement,
    Message,
    PlantEvent,
    State,
    Stop,
    Telemetry,
    Waiting,
)

KEYS = Keys("toy")
T_C = 0.02


class Lab:
    """The toy plant on a fake clock, with all agents played by the test."""

    def __init__(self, n: int = 3, *, spares: tuple[str, ...] = (), **changes: Any) -> None:
        config, _ = toy_configs(n, end=2.0)
        config = replace(
            config,
            clock="wall",
            settings=replace(config.settings, spares=spares),
            agents=tuple(name for name in config.agents if name not in spares),
        )
        config = replace(config, **changes)
        self.now = 50.0
        self.toy = ToyPlant(config)
        self.side = RealtimePlant(config, self.toy)
        self.sent: list[tuple[str, Message]] = []
        self.fetched: list[str] = []
        self.side.start(self.now)
        self.do()

    def do(self) -> None:
        """Take the actions, and let it work."""
        while True:
            for action in self.side.take_actions():
                if isinstance(action, Publish):
                    self.sent.append((action.key, decode(action.payload)))
                elif isinstance(action, Fetch):
                    self.fetched.append(action.key)
            if not self.side.work(self.now):
                return

    def token(self, name: str, instance: str = "a", *, gone: bool = False) -> None:
        """A token of an agent comes or goes."""
        (self.side.vanished if gone else self.side.appeared)(KEYS.alive_agent(name, instance), self.now)
        self.do()

    def join(self, *names: str, instance: str = "a", life: int = 1) -> None:
        """Agents come, and answer for their nameplates."""
        for name in names:
            self.token(name, instance)
            plate = replace(Agent(agent_config(name)).nameplate, epoch=life)
            self.hear(KEYS.nameplate(name, instance), plate)

    def hear(self, key: str, message: Message) -> None:
        """A message comes in."""
        self.side.received(key, encode(message), self.now)
        self.do()

    def state(self, name: str, seq: int, P_set: float, life: int = 1, *, fault: str = "") -> None:
        """An agent's state comes in."""
        state = State(
            sender=name,
            epoch=life,
            seq=seq,
            t=0.0,
            P_set=P_set,
            V_set=277.0,
            Q=0.0,
            fault=fault,
            idle=bool(fault),
        )
        self.hear(KEYS.state(name), state)

    def leave(self, name: str, life: int = 1) -> None:
        """An agent says that it leaves."""
        self.hear(KEYS.leave(name), Leave(sender=name, epoch=life, seq=0, t=0.0))

    def ask(self, verb: Any, argument: str | dict[str, Any] = "", **further: Any) -> Answer:
        """Send a command with a name, or with a command to links."""
        content = {"argument": argument} if isinstance(argument, str) else {"link_command": argument}
        command = Command(sender="cli", epoch=1, seq=7, t=0.0, verb=verb, reply_to="z1", **content, **further)
        self.hear(KEYS.command, command)
        key, answer = next((key, m) for key, m in reversed(self.sent) if isinstance(m, Answer))
        assert (key, answer.seq) == (KEYS.answer("z1"), 7)
        return answer

    def step(self, count: int = 1, delay: float = 0.0) -> None:
        """Make steps, each so late (s)."""
        for _ in range(count):
            self.now = max(self.now, self.side.deadline + delay)  # in a rush after a late step, the next is due already
            self.side.expire(self.now)
            self.do()

    def take(self, kind: type[Message]) -> list[Any]:
        """Messages of a type since last taken."""
        taken = [message for _, message in self.sent if type(message) is kind]
        self.sent = [(key, message) for key, message in self.sent if type(message) is not kind]
        return taken

    def events(self, kind: str) -> list[PlantEvent]:
        """Events of a kind, once the run has been ended."""
        self.side.interrupt("enough", self.now)
        self.do()
        telemetry: list[Telemetry] = self.take(Telemetry)
        return [event for message in telemetry for event in message.events if event.kind == kind]


def running(n: int = 3, **changes: Any) -> Lab:
    """A plant that runs, with all its agents."""
    lab = Lab(n, **changes)
    lab.join(*lab.side.config.agents)
    assert lab.side.phase == "running"
    return lab


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


def test_who_leaves_takes_its_inverter_off_and_who_returns_puts_it_on() -> None:
    """The vanished token of who has left is no death; the next life counts from 0 again."""
    lab = running()
    lab.state("inv2", 40, 60e3)
    lab.leave("inv2")
    lab.token("inv2", gone=True)
    lab.step()
    away = lab.toy.measure()["inv2"].P
    assert [m.to for m in lab.take(Measurement)] == ["inv1", "inv3"]
    lab.join("inv2", instance="b", life=2)
    lab.state("inv2", 0, 55e3, life=2)
    lab.step()

    assert away == 0.0
    back = lab.toy.measure()["inv2"]
    assert back.P_set == pytest.approx(55e3)
    texts = [event.text for event in lab.events("roster")]
    assert [text.split(",")[0].split(";")[0] for text in texts[3:]] == ["inv2 left", "inv2 joined"]


def test_who_dies_stays_on_primary_droop() -> None:
    """Its inverter is not switched, and keeps the set-points; the run goes on."""
    lab = running()
    lab.state("inv2", 0, 60e3)
    lab.step()
    lab.token("inv2", gone=True)
    lab.step()

    held = lab.toy.measure()["inv2"].P
    assert held == pytest.approx(60e3)
    assert lab.side.phase == "running"
    assert "inv2 died; its inverter stays on primary droop" in lab.events("roster")[-1].text


def test_a_spare_inverter_comes_on_line_with_its_agent() -> None:
    """It is not waited for; nobody else is touched."""
    lab = running(4, spares=("inv4",))
    lab.step()
    assert lab.toy.measure()["inv4"].P == 0.0
    lab.join("inv4")
    lab.step()

    on_line = lab.toy.measure()["inv4"].P
    assert on_line == pytest.approx(50e3)
    assert [event.text for event in lab.events("inverter")] == ["inv4 connected"]


def test_a_second_agent_of_a_name_and_one_of_no_inverter_are_refused() -> None:
    """By name; who was first goes on, and a ghost's messages count for nothing."""
    lab = running()
    lab.token("inv2", "b")
    lab.token("inv9", "c")
    lab.leave("inv2", life=9)
    lab.step()
    keys = [key for key, message in lab.sent if isinstance(message, Stop)]
    stops: list[Stop] = lab.take(Stop)

    assert keys == [KEYS.stop_request("inv2", "b"), KEYS.stop_request("inv9", "c")]
    assert all(stop.refused for stop in stops)
    assert stops[0].reason.startswith("inv2: another agent of this name takes part in run toy already")
    assert stops[1].reason == "inv9: no inverter of this name; inverters are inv1, inv2, inv3"
    assert len(lab.take(Measurement)) == 3
    assert lab.side.rejects.counts["ghost"] == 1


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


def test_who_leaves_by_the_scenario_is_asked_to_and_who_joins_is_awaited() -> None:
    """At its tick the leaver alone is told to stop, and is off once it says so; telemetry tells once who is to come."""
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
    lab.join("inv2", instance="b", life=2)

    assert stops == [(KEYS.stop_request("inv2", "a"), False)]
    assert off == 0.0
    assert awaited == [(0.2, ("inv2",))]
    assert lab.toy.measure()["inv2"].P != 0.0


def test_a_nameplate_that_does_not_come_is_asked_for_again() -> None:
    """A question can die with the link it went over, though the agent's token stays; the answer ends the asking."""
    lab = running(2)
    lab.token("inv2", gone=True)
    lab.token("inv2", "b")
    lab.step(60)
    asked = lab.fetched.count(KEYS.nameplate("inv2", "b"))
    lab.hear(KEYS.nameplate("inv2", "b"), replace(Agent(agent_config("inv2")).nameplate, epoch=2))
    lab.step(60)

    assert asked == 2
    assert lab.fetched.count(KEYS.nameplate("inv2", "b")) == 2
    assert [m.to for m in lab.take(Measurement)][-1] == "inv2"


def test_an_agent_that_comes_while_the_run_ends_is_told_so() -> None:
    """An agent whose session was renewed just then has not heard the end; else it would seek a plant for minutes."""
    lab = Lab()
    lab.join("inv1", "inv2", "inv3")
    lab.side.abort("the end of it", lab.now)
    lab.do()
    lab.token("inv2", gone=True)
    lab.sent.clear()
    lab.token("inv2", "b")

    ((key, stop),) = lab.sent
    assert key == KEYS.stop_request("inv2", "b")
    assert isinstance(stop, Stop)
    assert stop.reason == "the end of it"
    assert not stop.refused


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


def test_a_run_is_ended_once() -> None:
    """A second order to end a run that ends already is refused, and does not end it anew."""
    lab = running()
    lab.step()
    answers = [lab.ask("down"), lab.ask("down")]

    assert [(answer.ok, answer.text) for answer in answers][1] == (False, "the run is ending")
    assert answers[0].ok
    assert [message.final for message in lab.take(Telemetry)].count(True) == 1


def test_of_thousands_that_are_refused_some_are_told() -> None:
    """Anybody may hold tokens: the first are told, then ten a second; the others are counted."""
    lab = running(3)
    lab.take(Stop)
    for i in range(5_000):
        lab.side.appeared(KEYS.alive_agent("inv2", f"x{i}"), lab.now)
        lab.side.appeared(KEYS.alive_agent(f"who{i}", "x"), lab.now)
    lab.do()
    told = lab.take(Stop)
    lab.now += 1.0
    lab.side.appeared(KEYS.alive_agent("inv2", "y"), lab.now)
    lab.do()

    assert len(told) == REFUSALS
    assert all(stop.refused for stop in told)
    assert lab.side.rejects.counts["excess"] == 10_000 - REFUSALS
    assert len(lab.take(Stop)) == 1


def test_an_ended_run_neither_waits_for_strangers_nor_tells_all_of_them() -> None:
    """Thousands that were refused, and thousands that come after the end: it is over once its own agents are gone."""
    lab = running(3)
    for i in range(3_000):
        lab.side.appeared(KEYS.alive_agent("inv2", f"x{i}"), lab.now)
    lab.ask("down")
    lab.now += REFUSALS * REFUSAL_INTERVAL
    lab.take(Stop)
    for i in range(3_000):
        lab.side.appeared(KEYS.alive_agent(f"who{i}", "x"), lab.now)
    lab.do()
    told = [key for key, message in lab.sent if isinstance(message, Stop)]
    for key in told:
        lab.side.vanished(KEYS.alive_agent(*KEYS.parts(key)[1:]), lab.now)
    for name in ("inv1", "inv2", "inv3"):
        assert not lab.side.finished
        lab.token(name, gone=True)

    assert len(told) == REFUSALS
    assert lab.side.finished


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


def test_of_a_token_it_says_whether_its_holder_takes_part() -> None:
    """Agents and recorders that it has noted, also one that has said that it leaves; not who was refused."""
    lab = running(3)
    lab.side.appeared(KEYS.alive_recorder("r"), lab.now)
    lab.token("inv2", "b")
    lab.leave("inv3")
    noted = {key: lab.side.is_noted(key) for key in map(KEYS.alive_agent, ("inv1", "inv2", "inv3"), "aba")}

    assert list(noted.values()) == [True, False, True]
    assert lab.side.is_noted(KEYS.alive_recorder("r"))
    assert not lab.side.is_noted(KEYS.alive_recorder("s"))
    assert not lab.side.is_noted("gridpeers/toy/alive/agent")


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
