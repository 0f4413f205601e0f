"""The plant detects silent agents: a frozen one, and two without a path between them."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from msgspec.structs import replace

from gridpeers.plant.realtime.silence_detector import SilenceDetector
from gridpeers.wire.messages import AgentStatus
from tests.golden.messages.message_values import STATUS
from tests.unit.plant.plant_lab import KEYS
from tests.unit.plant.realtime.realtime_lab import T_C, Lab, running

NAMES = ("inv1", "inv2", "inv3")
MAX_AGE = 0.25


def status(name: str, ages: dict[str, float], seq: int = 0) -> AgentStatus:
    of_neighbours = {"phase": "running", "neighbours": tuple(ages), "ages": tuple(ages.values())}
    return AgentStatus(**STATUS | of_neighbours, sender=name, epoch=1, seq=seq, t=0.0)


def all_tick(lab: Lab, steps: int, names: Iterable[str] = NAMES) -> None:
    """Steps of the plant, before each of which these agents send a state."""
    for _ in range(steps):
        for name in names:
            lab.state(name, lab.node.stepper.tick, 50e3)
        lab.step()


def told(lab: Lab) -> list[tuple[float, str]]:
    """Run time and text of what was told of silence, without the joins at the start."""
    return [(event.t, event.text) for event in lab.events("roster") if " joined" not in event.text]


def test_an_agent_whose_law_failed_is_silent_with_that_reason() -> None:
    """Its last state has the reason, so no path is suspected."""
    lab = running(end=None)
    all_tick(lab, 100)
    lab.state("inv2", lab.node.stepper.tick, 50e3, fault="law mine:Mine: step raised")
    all_tick(lab, 20, ("inv1", "inv3"))

    assert [text.partition(", at")[0] for _, text in told(lab)] == [
        "inv2 is silent: no state for 0.25 s, as its law has failed"
    ]


def test_a_silent_agent_is_reported_once_and_once_when_it_is_heard_again() -> None:
    """It is silent once neighbours reject its state as too old, long before its token vanishes."""
    lab = running(end=None)
    all_tick(lab, 100)
    all_tick(lab, 10, ("inv1", "inv3"))
    all_tick(lab, 50)
    frozen = lab.node.stepper.t - T_C
    all_tick(lab, 60, ("inv1", "inv3"))
    woken = lab.node.stepper.t
    all_tick(lab, 10)

    (silent_at, silent), (again_at, again) = told(lab)
    assert silent.startswith("inv2 is silent: no state for 0.25 s, nothing comes from it")
    assert MAX_AGE <= silent_at - frozen <= MAX_AGE + 0.04
    assert again.startswith("inv2 is heard again")
    assert woken <= again_at <= woken + 0.04


@pytest.mark.parametrize("stalls", [(3.0,), (0.18, 0.18, 0.18)])
def test_a_plant_that_stood_still_reports_no_agent_as_silent(stalls: tuple[float, ...]) -> None:
    """Ticks that the plant itself missed or hurried count against no agent; a death or a leave is reported once."""
    lab = running(end=None)
    all_tick(lab, 50)
    for delay in stalls:
        lab.step(delay=delay)
        all_tick(lab, round(delay / T_C) - 1 if delay < 1.0 else 0, ())
    all_tick(lab, 20)
    lab.leave("inv2")
    lab.token("inv3", gone=True)
    all_tick(lab, 50, ("inv1",))

    assert [text.split(",")[0].split(";")[0] for _, text in told(lab)] == ["inv2 left", "inv3 died"]


def test_two_agents_that_do_not_hear_each_other_are_reported_though_the_plant_hears_both() -> None:
    """A cut between hosts: the neighbour's ages say so. It holds on when the token of the one is gone at the other."""
    lab = running(end=None)
    all_tick(lab, 100)
    cut = lab.node.stepper.t
    lab.hear(KEYS.status("inv1"), status("inv1", {"inv2": 0.27, "inv3": 0.01}))
    lab.hear(KEYS.status("inv2"), status("inv2", {"inv1": 0.27, "inv3": 0.01}))
    all_tick(lab, 100)
    lab.hear(KEYS.status("inv1"), status("inv1", {"inv3": 0.01}))
    all_tick(lab, 50)
    lab.hear(KEYS.status("inv1"), status("inv1", {"inv2": 0.0, "inv3": 0.01}))
    all_tick(lab, 5)

    (t1, first), (t2, second), (_, third) = told(lab)
    assert first.startswith("inv1 does not hear inv2: no state for 0.25 s, but the plant hears it")
    assert second.startswith("inv2 does not hear inv1")
    assert third.startswith("inv1 hears inv2 again")
    assert cut <= t1 == t2 <= cut + 0.2


def test_neighbours_of_a_frozen_agent_are_not_reported() -> None:
    """The silent agent is enough; an agent that has just joined or woken may not have heard others yet."""
    lab = running(end=None)
    lab.hear(KEYS.status("inv1"), status("inv1", {"inv2": -1.0}))
    all_tick(lab, 1)
    lab.hear(KEYS.status("inv1"), status("inv1", {"inv2": 0.0, "inv3": 0.0}))
    all_tick(lab, 100)
    for seq, name in enumerate(("inv1", "inv3")):
        lab.hear(KEYS.status(name), status(name, {"inv2": 0.26}, seq))
    all_tick(lab, 60, ("inv1", "inv3"))
    all_tick(lab, 2)  # it is back: its states are on their way to the others, too
    for seq, name in enumerate(("inv1", "inv3"), 2):
        lab.hear(KEYS.status(name), status(name, {"inv2": 0.0}, seq))
    all_tick(lab, 20)

    assert [text.split(",")[0].split(":")[0] for _, text in told(lab)] == ["inv2 is silent", "inv2 is heard again"]


@pytest.mark.parametrize(("at", "why"), [(2, "nothing comes from it"), (90, "it says that it has no measurement")])
def test_an_agent_without_measurement_differs_from_a_frozen_one(at: int, why: str) -> None:
    """Its status says so; but that of a start, when all wait for the first measurement, proves nothing."""
    silence = SilenceDetector(max_age=0.25, T_c=0.02, period=0.02)
    silence.joined("inv1")
    for tick in range(90):
        silence.heard("inv1")
        if tick == at - 1:
            silence.reported(replace(status("inv1", {}), phase="waiting"))
        assert list(silence.take(0.02 * tick)) == []
    if at == 90:
        silence.reported(replace(status("inv1", {}), phase="waiting"))

    assert [text for tick in range(90, 120) for _, text in silence.take(0.02 * tick)] == [
        f"inv1 is silent: no state for 0.25 s, {why}"
    ]


@pytest.mark.parametrize("period", [0.02, 0.001])
def test_an_agent_never_heard_is_reported_after_both_had_time_to_meet(period: float) -> None:
    """-1 means never: a second of real time after a join, at every speed, that is news."""
    silence = SilenceDetector(max_age=0.25, T_c=0.02, period=period)
    for name in NAMES:
        silence.joined(name)
    silence.reported(status("inv1", {"inv2": -1.0}))

    said = []
    for tick in range(round(1.1 / period)):
        for name in NAMES:
            silence.heard(name)
        said += [(tick * period, name) for name, _ in silence.take(tick * period)]
    [(when, who)] = said
    assert who == "inv1"
    assert 1.0 - 1e-9 <= when <= 1.0 + 2.0 * period
