"""Laws in real time: one that does not tell its neighbours, and one that fails."""

from __future__ import annotations

from collections.abc import Sequence

from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints
from gridpeers.wire.messages import State
from tests.toy.toy_messages import T_C
from tests.unit.agents.realtime_lab import KEYS, running


class Quiet(Law):
    """Counts up, and tells nobody after the first step; shares its count."""

    def start(self, own: Own) -> None:
        self.steps = 0

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        self.steps += 1
        return SetPoints(0.5, 1.0, {"steps": float(self.steps)}, send=self.steps == 1)


class Divides(Law):
    """Fails at its second step."""

    def start(self, own: Own) -> None:
        self.steps = 0

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        self.steps += 1
        return SetPoints(0.5 / (2 - self.steps), 1.0)


def test_a_quiet_agent_sends_to_the_plant_alone_and_shows_itself_before_it_counts_as_silent() -> None:
    """Neighbours drop a state after 0.25 s: at half of that they get a state that counts the quiet ones."""
    lab = running(law=Quiet())
    for k in range(1, 14):
        lab.measure(k)
        lab.go(T_C)
    states = lab.decided()
    told = [state for state in states if not state.quiet]

    assert [state.shared["steps"] for state in states] == [float(i) for i in range(2, 15)]
    assert [round(state.t, 2) for state in told] == [0.14]
    assert told[0].skipped == 6
    keys = [key for key in lab.keys if key in (KEYS.state("inv1"), KEYS.set_points("inv1"))]
    assert (
        keys
        == [KEYS.state("inv1")] + [KEYS.set_points("inv1")] * 6 + [KEYS.state("inv1")] + [KEYS.set_points("inv1")] * 6
    )


def test_a_failing_law_is_reported_once_and_its_agent_sends_nothing_more() -> None:
    """The plant gets the reason in a last state, which no neighbour uses; the log has it too.

    That the plant does not hear it from then on is no reason for a new session.
    """
    lab = running("inv2", law=Divides())
    for k in range(1, 300):
        lab.measure(k, roster=("inv1", "inv2") if k < 10 else ("inv2",))
        lab.state("inv2", k, k * T_C)
        lab.go(T_C)
    said: list[State] = lab.decided()

    step = "step at t = 0.02 s raised ZeroDivisionError: float division by zero"
    assert [state.idle for state in said] == [True]
    assert said[0].fault == f"law consensus (test_realtime_laws.py:32): {step}"
    assert lab.said[-1].startswith(f"inv1: {said[0].fault}")
    assert not lab.side.finished
    assert not lab.side.session_broken
