"""The plant under simulated time, on a fake clock, and its telemetry."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import pytest
from msgspec.structs import replace

from gridpeers.plant.meeting import AGAIN
from gridpeers.plant.plant_config import ScheduledAction
from gridpeers.plant.plant_interface import Reading
from gridpeers.plant.plant_node import PHASES
from gridpeers.plant.plant_stepper import measurement_of
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.messages import Answer, Command, Measurement, Prepare, Ready, Stop, Telemetry, Waiting
from gridpeers.wire.phases import diagram
from tests.toy.toy_configs import toy_configs
from tests.unit.plant.plant_lab import KEYS, PlantLab

NAMES = ("inv1", "inv2", "inv3", "inv4")


class Lab(PlantLab):
    """The toy plant in simulated time."""

    def __init__(
        self,
        *schedule: tuple[float, str, Literal["leave", "join", "die"]],
        n: int = 4,
        spares: tuple[str, ...] = (),
        **changes: Any,
    ) -> None:
        config, _ = toy_configs(n, spares=spares)
        actions = tuple(ScheduledAction(t=t, inverter=name, action=action) for t, name, action in schedule)
        super().__init__(replace(config, **changes, schedule=actions))
        self._read = 0

    def wait(self, seconds: float) -> None:
        """Time passes, and the node is woken when it asks for it."""
        end = self.now + seconds
        while (due := self.node.deadline) is not None and due <= end:
            self.now = due
            self.node.expire(self.now)
            self.do()
        self.now = end

    def needs(self, number: int) -> None:
        """The recorder says which Telemetry it needs next."""
        command = Command(
            sender="history", epoch=1, seq=1, t=0.0, verb="telemetry", argument=str(number), reply_to="history"
        )
        self.hear(KEYS.request, command)

    def telemetry(self) -> list[int]:
        """Numbers of the Telemetry sent since the last call."""
        numbers = [message.seq for _, message in self.sent[self._read :] if isinstance(message, Telemetry)]
        self._read = len(self.sent)
        return numbers

    def ready(self, number: int, *names: str) -> None:
        for name in names:
            self.hear(KEYS.ready(name), Ready(sender=name, epoch=1, seq=number, t=0.0))

    def states(self, k: int, *names: str) -> None:
        for name in names:
            self.state(name, k)

    def tick(self, count: int) -> None:
        for _ in range(count):
            self.states(self.node.stepper.tick, *self.last(Prepare).roster)

    def last(self, kind: type[Any]) -> Any:
        return [message for _, message in self.sent if isinstance(message, kind)][-1]

    def stopped(self) -> dict[tuple[str, ...], tuple[str, bool]]:
        """Processes that were told to close: why, and whether they were refused."""
        stops = [(KEYS.parts(key), message) for key, message in self.sent if isinstance(message, Stop)]
        return {parts[1:]: (message.reason, message.refused) for parts, message in stops if parts[0] == "stop_request"}

    @property
    def missing(self) -> list[tuple[str, str]]:
        return [(what, who) for what, who in self.node.missing_messages()]


def recorded(**changes: Any) -> Lab:
    """A plant that ticks, beside a recorder that has all so far."""
    lab = Lab(recorders=("history",), **changes)
    lab.recorder("history")
    lab.join(*NAMES)
    lab.ready(0, *NAMES)
    lab.needs(1)
    assert lab.telemetry() == [0]
    return lab


def ticking(*schedule: tuple[float, str, Literal["leave", "join", "die"]], **changes: Any) -> Lab:
    """A plant that ticks with everybody of its configuration."""
    lab = Lab(*schedule, **changes)
    names = lab.node.config.agents
    lab.join(*names)
    lab.ready(0, *names)
    assert lab.node.phase == "running"
    return lab


# ---------------------------------------------------------------- who takes part


def test_who_may_come_depends_on_the_time() -> None:
    """A stranger never, a spare only when the tick is held for it, anybody else once, and only before the start."""
    lab = Lab((0.1, "inv4", "join"), spares=("inv4",))
    lab.token("inv1")
    lab.token("inv1", "b")
    reason, refused = lab.stopped()["inv1", "b"]
    assert refused
    assert "another agent of this name takes part" in reason
    lab.token("inv9")
    lab.token("inv4")
    assert lab.stopped()["inv9", "inv9"][0].endswith("only for inv1, inv2, inv3, inv4")
    assert "join later" in lab.stopped()["inv4", "inv4"][0]

    lab.join("inv1", "inv2", "inv3")
    lab.ready(0, "inv1", "inv2", "inv3")
    lab.token("inv3", gone=True)
    lab.token("inv4", "early")
    lab.token("inv3", "again")
    assert "the run has begun, at t = 0 s" in lab.stopped()["inv4", "early"][0]
    assert "the run has begun, at t = 0 s" in lab.stopped()["inv3", "again"][0]
    lab.states(0, "inv1", "inv2")
    lab.ready(1, "inv1", "inv2")
    lab.tick(4)
    assert lab.node.phase == "joining"
    lab.token("inv4", "now")
    assert ("inv4", "now") not in lab.stopped()


# ---------------------------------------------------------------- what it waits for


def test_before_the_start_agents_and_recorders_are_awaited() -> None:
    """Tokens before nameplates, recorders last."""
    lab = Lab(n=3, recorders=("fleet",))
    lab.token("inv1")
    lab.join("inv3")
    assert lab.missing == [("token", "inv2"), ("nameplate", "inv1"), ("token", "fleet")]

    lab.recorder("fleet")
    assert lab.missing == [("token", "inv2"), ("nameplate", "inv1")]


def test_everybody_must_be_ready_for_this_roster() -> None:
    """Word on an earlier one is stale; whoever dies after the beginning is not awaited."""
    lab = ticking((0.02, "inv1", "die"))
    lab.states(0, *NAMES)
    assert lab.missing == [("Ready(1)", name) for name in NAMES[1:]]

    lab.ready(0, "inv2")
    assert lab.node.rejects.counts == {"stale": 1}
    lab.ready(1, "inv2")
    lab.token("inv3", gone=True)  # nobody can get ready to hear the dead: the next roster is without it
    lab.ready(2, "inv2", "inv4")
    assert lab.node.phase == "running"


def test_one_state_of_everybody_is_awaited_at_a_tick() -> None:
    """`wanted` counts down to one, and what is missing is named in the order of the roster."""
    lab = ticking()
    assert lab.missing == [("State(0)", name) for name in NAMES]
    assert lab.node.messages_needed == 4
    lab.states(0, "inv1", "inv4", "inv3")
    assert (lab.missing, lab.node.messages_needed) == ([("State(0)", "inv2")], 1)

    lab.states(0, "inv2")
    assert lab.node.stepper.tick == 1
    assert lab.last(Measurement).seq == 1


@pytest.mark.parametrize(("k", "kind"), [(3, "stale"), (4, "stale"), (5, "unexpected")])
def test_a_state_that_is_not_awaited_is_refused(k: int, kind: str) -> None:
    """One of another tick, and a second one of this tick."""
    lab = ticking()
    lab.tick(4)
    lab.states(4, "inv1")
    lab.states(k, "inv1")

    assert lab.node.rejects.counts == {kind: 1}


def test_a_prepare_is_sent_again_until_all_are_ready() -> None:
    """The same one, as it or a `Ready` may be lost; each answer is progress; a late second `Ready` is no mistake."""
    lab = Lab()
    lab.join(*NAMES)
    lab.ready(0, *NAMES[:3])
    lab.wait(AGAIN)
    assert [message for _, message in lab.sent if isinstance(message, Prepare)] == [lab.last(Prepare)] * 2

    lab.ready(0, *NAMES)
    lab.ready(0, "inv1")
    lab.wait(5.0)
    assert lab.node.phase == "running"
    assert lab.node.rejects.counts == {}
    assert lab.missing == [("State(0)", name) for name in NAMES]
    assert len([message for _, message in lab.sent if isinstance(message, Prepare)]) == 2


def test_a_nameplate_is_asked_for_again_until_it_comes() -> None:
    """Before the start, and of a newcomer; the deadline counts from the last that came."""
    lab = Lab((0.02, "inv4", "join"), spares=("inv4",), deadline=10.0)
    for name in NAMES[:3]:
        lab.token(name)
    lab.wait(AGAIN)
    assert lab.fetched == [(name, name) for name in NAMES[:3]] * 2
    lab.join("inv1")
    lab.wait(9.5)
    assert lab.node.stepper.outcome == ""

    lab.join("inv2", "inv3")
    lab.ready(0, *NAMES[:3])
    lab.tick(1)
    lab.token("inv4")
    lab.fetched.clear()
    lab.wait(AGAIN)
    assert lab.fetched == [("inv4", "inv4")]
    lab.wait(10.0)
    assert lab.node.stepper.outcome.startswith("plant: no nameplate from inv4 within 10 s")


def test_the_deadline_names_who_is_missing_but_a_plant_that_stood_still_reports_no_agent_as_silent() -> None:
    """Its clock ran on while messages waited: it waits anew, then names agent, message, time and last sign of life."""
    lab = ticking(deadline=10.0)
    lab.states(0, "inv1", "inv3", "inv4")
    lab.now += 60.0
    lab.node.expire(lab.now)
    assert (lab.node.stepper.outcome, lab.node.deadline) == ("", lab.now + 10.0)

    lab.wait(10.0)
    assert (
        lab.node.stepper.outcome == "plant: no State(0) from inv2 within 10 s; last heard of inv2: tick 0, 70.0 s ago"
    )
    assert lab.node.phase == "closing"


# ---------------------------------------------------------------- recorders


def test_what_a_recorder_needs_once_more_is_published_again() -> None:
    """From that number on and as it was; a recorder that goes on gets nothing twice; nobody else is heard."""
    lab = recorded(end=20.0)
    lab.tick(40)
    assert lab.telemetry() == [1, 2, 3, 4]
    lab.needs(2)
    assert lab.telemetry() == []
    lab.needs(2)

    assert lab.telemetry() == [2, 3, 4]
    assert lab.last(Answer).text == "2"
    again = [message for _, message in lab.sent if isinstance(message, Telemetry) and message.seq == 3]
    assert again[0] == again[1]
    lab.hear(
        KEYS.request, Command(sender="other", epoch=1, seq=1, t=0.0, verb="telemetry", argument="9", reply_to="other")
    )
    assert lab.node.rejects.counts == {"unexpected": 1}


def test_the_plant_leaves_once_its_recorder_has_the_end() -> None:
    """The recorder's token may go with its link: only its word counts, and what it misses comes again."""
    lab = recorded(end=0.2)
    lab.tick(10)
    for name in NAMES:
        lab.token(name, gone=True)
    lab.recorder("history", gone=True)
    lab.wait(600.0)
    assert lab.node.phase == "recording"
    lab.recorder("history")
    (final,) = lab.telemetry()
    lab.needs(final)
    assert lab.telemetry() == [final]
    assert not lab.node.finished

    lab.needs(final + 1)
    assert lab.node.finished


def test_no_agent_is_late_while_the_recorder_is_silent() -> None:
    """The recorder's process starts the agents: if it stands still, they cannot come; it may come late itself."""
    lab = Lab(recorders=("history",), deadline=10.0)
    lab.join("inv1")
    lab.wait(600.0)
    assert lab.missing[-1] == ("token", "history")
    waiting = [message for _, message in lab.sent if isinstance(message, Waiting)]
    assert len(waiting) == 600  # else the agents that have come would give the plant up
    assert waiting[0].waits_for == ("inv2", "inv3", "inv4", "history")
    lab.recorder("history")
    for _ in range(9):
        lab.needs(0)
        lab.wait(1.0)
    assert lab.node.stepper.outcome == ""
    for _ in range(10):
        lab.needs(0)
        lab.wait(1.0)
    assert lab.node.stepper.outcome.startswith("plant: no token from inv2 within 10 s")


CALM = Reading(5e4, 1e3, 277.0, 60.0, 5e4, 277.0, False, "inv1")


def measured(**changes: Any) -> Measurement:
    """Measurement that an agent receives of a reading."""
    reading = CALM._replace(**changes)
    message = decode(encode(measurement_of("inv1", reading, epoch=1, tick=0, t=0.0)))
    assert isinstance(message, Measurement)
    return message


def test_a_sensor_shows_the_end_of_its_scale_and_never_more() -> None:
    """A plant that swings beyond all measure still grants its ticks: whatever it reads, its agents take it."""
    wild = measured(f=1e6, P=-1e15, Q=1e15, V=1e9, P_set=1e300, V_set=-5.0)

    assert (wild.f, wild.P, wild.Q, wild.V, wild.P_set, wild.V_set) == (2000.0, -1e11, 1e11, 1e6, 1e11, 0.0)
    assert measured() == measured(f=60.0)
    assert (measured().f, measured().P) == (60.0, 5e4)


def test_the_page_of_the_architecture_has_the_table_of_phases() -> None:
    """Its picture is drawn from the table."""
    assert diagram(PHASES) in (Path(__file__).parents[3] / "docs" / "architecture.md").read_text()
