"""Checks of the plant's rows: the sound case passes, and each planted fault is caught, with time, agent and value."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gridpeers.plant.plant_stepper import IDLE
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.wire.messages import PlantEvent
from tests.unit.scenarios.checks.cases import changed, ran, ran_with, verdict

PLANT_CHECKS = ("frequency", "voltage", "power_sharing", "var_sharing", "rating", "oscillation", "steady")

Arrays = dict[str, np.ndarray[Any, Any]]


@pytest.fixture(scope="module")
def sound() -> CheckedCase:
    """Islanding under full coordination."""
    return ran().checked_case


@pytest.mark.parametrize("check", PLANT_CHECKS)
def test_a_sound_run_passes(sound: CheckedCase, check: str) -> None:
    """Full coordination keeps every limit that is on by default."""
    found = verdict(sound, check)

    assert (found.status, found.sentence) == ("passed", f"{check} passed")


def test_a_frequency_out_of_its_band_is_caught(sound: CheckedCase) -> None:
    """The inverter, the row that is farthest off, and the limit are named; before the limit's time it may be off."""

    def fault(of: Arrays) -> None:
        of["f"][(of["t"] > 6.3) & (of["t"] < 6.45), 3] = 60.05

    found = verdict(changed(sound, fault), "frequency")

    assert found.status == "failed"
    assert (found.violations[0].agent, found.violations[0].unit, found.violations[0].limit) == ("inv4", "Hz", 0.01)
    assert found.violations[0].value == pytest.approx(0.05)
    assert found.violations[0].t == pytest.approx(6.31)
    assert verdict(changed(sound, fault), "frequency", within_s=2.5).status == "passed"


def test_an_island_without_a_grid_forming_inverter_is_caught(sound: CheckedCase) -> None:
    """A dark island has no frequency to be in a band: that is no pass."""

    def fault(of: Arrays) -> None:
        forming = sound.nameplates.GFM
        for name in ("P", "Q"):
            of[name][np.ix_(of["t"] > 6.5, forming)] = 0.0

    found = verdict(changed(sound, fault), "frequency")

    assert found.status == "failed"
    assert "no grid-forming inverter is on the network, event2" in found.violations[0].sentence


@pytest.mark.parametrize(("V", "limit"), [(1.15, 1.10), (0.85, 0.88)])
def test_a_voltage_out_of_its_band_is_caught(sound: CheckedCase, V: float, limit: float) -> None:
    """Above and below, at one inverter."""

    def fault(of: Arrays) -> None:
        of["V"][of["t"] > 6.9, 4] = V * sound.nameplates.V_nom[4]

    found = verdict(changed(sound, fault), "voltage")

    assert found.count == 1
    assert (found.violations[0].agent, found.violations[0].limit) == ("inv5", limit)
    assert found.violations[0].value == pytest.approx(V)


@pytest.mark.parametrize(("check", "quantity"), [("power_sharing", "P"), ("var_sharing", "Q")])
def test_unequal_sharing_is_caught(sound: CheckedCase, check: str, quantity: str) -> None:
    """One inverter takes over from another: the sum stays."""

    def fault(of: Arrays) -> None:
        taken = 0.9 * of[quantity][:, 1]
        of[quantity][:, 1] -= taken
        of[quantity][:, 7] += taken

    found = verdict(changed(sound, fault), check)

    assert found.status == "failed"
    assert found.violations[0].agent in ("inv2", "inv8")
    assert (found.violations[0].value or 0.0) > (found.violations[0].limit or 0.0)


def test_an_inverter_at_its_available_power_need_not_share() -> None:
    """Clouds that leave an inverter less than its share are no fault of the control."""
    case = ran("intermittency", "225kW").checked_case

    assert verdict(case, "power_sharing").status == "passed"
    assert ran("intermittency", "225kW").metrics["MPSI"]["clouds"] > 0.01


def test_a_lasting_overload_is_caught(sound: CheckedCase) -> None:
    """Its length is the value; a shorter one passes. Of real power less is too much."""

    def fault(of: Arrays) -> None:
        of["Q"][(of["t"] > 5.0 - 1e-9) & (of["t"] < 6.2 + 1e-9), 2] = 1.4 * sound.nameplates.s[2]

    found = verdict(changed(sound, fault), "rating")

    assert (found.status, found.violations[0].agent, found.violations[0].t) == ("failed", "inv3", 5.0)
    assert found.violations[0].value == pytest.approx(1.2)
    assert verdict(changed(sound, fault), "rating", longest_s=1.3).status == "passed"

    def real(of: Arrays) -> None:
        of["P"][(of["t"] > 5.0 - 1e-9) & (of["t"] < 6.2 + 1e-9), 2] = 1.1 * sound.nameplates.s[2]

    assert "P above 1.05 pu of the rating" in verdict(changed(sound, real), "rating").sentence


@pytest.mark.parametrize(("f", "damping"), [(1.3, 0.02), (2.1, -0.01), (25.0, 0.0)])
def test_a_lasting_oscillation_is_caught(sound: CheckedCase, f: float, damping: float) -> None:
    """Slow and fast, lasting, growing and hardly damped: frequency and damping are found."""

    def fault(of: Arrays) -> None:
        tail = of["t"] - 4.0
        of["P"][:, 5] += 0.1 * sound.nameplates.s[5] * np.exp(-damping * 6.28 * f * tail) * np.sin(6.2832 * f * tail)

    found = verdict(changed(sound, fault), "oscillation")

    assert (found.status, found.violations[0].agent, found.violations[0].unit) == ("failed", "inv6", "%")
    assert f"at {f:.2g} Hz" in found.violations[0].text
    assert found.violations[0].value == pytest.approx(100.0 * damping, abs=0.2)


def test_a_value_that_still_moves_is_caught(sound: CheckedCase) -> None:
    """A drift of the frequency by 0.1 Hz/s at the end of a window is no steady value."""

    def fault(of: Arrays) -> None:
        of["f"][:, 0] += 0.1 * np.clip(of["t"] - 6.0, 0.0, None)

    found = verdict(changed(sound, fault), "steady")

    assert [it.sentence for it in found.violations] == [
        "abs(f-60) not steady: inv1 still moves +0.1 Hz/s, event2: at t = 7.00 s"
    ]


@pytest.mark.parametrize("check", [*PLANT_CHECKS, "stale_values"])
def test_a_verdict_on_nothing_is_not_passed(sound: CheckedCase, check: str) -> None:
    """Without an event there is no window to judge, and after the end of the run at 7 s nothing at all."""
    assert check == "oscillation" or verdict(sound, check, since_s=7.1).status == "not judged"
    if check not in ("rating", "oscillation", "stale_values"):
        found = verdict(replace(sound, windows=()), check)
        assert (found.status, found.reason) == ("not judged", "the run has no event")


def test_a_time_of_overload_longer_than_the_run_is_not_judged(sound: CheckedCase) -> None:
    """No run of 7 s could break it; from 6.5 s on half a second is left, which cannot break 1 s either."""
    assert verdict(sound, "rating", longest_s=3600.0).sentence == (
        "rating not judged: the run is shorter than needed: it has 7 s to judge, and longest_s = 3600 s"
    )
    assert [verdict(sound, "rating", since_s=since).status for since in (6.5, 5.9)] == ["not judged", "passed"]


@pytest.mark.parametrize(
    ("check", "limits"),
    [("frequency", {"within_s": 0.5}), ("voltage", {"within_s": 0.5}), ("rating", {"longest_s": 0.1})],
)
def test_what_is_out_before_the_time_of_a_check_is_not_judged(
    sound: CheckedCase, check: str, limits: dict[str, float]
) -> None:
    """A fault of links or agents opens no window: `since_s` says from when on a check judges."""

    def fault(of: Arrays) -> None:
        during = (of["t"] > 5.0) & (of["t"] < 5.4)
        of["f"][during, 3], of["V"][during, 3], of["P"][during, 3] = 60.05, 3000.0, 1e6

    faulty = changed(sound, fault)

    assert verdict(faulty, check, **limits).status == "failed"
    assert verdict(faulty, check, **limits, since_s=4.8).status == "failed"
    assert verdict(faulty, check, **limits, since_s=5.5).status == "passed"


def test_an_inverter_whose_agent_was_killed_can_be_left_out() -> None:
    """It stays at its set-points, and does not share the load that is left; the others do."""
    killed = ran_with((("case.IV.node", repr([{"name": "inv5", "from_s": 2.0, "kill": True}])),)).checked_case

    assert verdict(killed, "power_sharing").status == "failed"
    assert verdict(killed, "power_sharing", with_killed=False).status == "passed"


def test_each_law_that_fails_is_a_violation_in_the_order_of_time() -> None:
    """It names the agent, the time, and the line of the law; agents come in the order of the inverters."""
    why = "law mine:Mine (mine.py:12): step at t = 1.2 s raised ValueError: no"
    events = [
        PlantEvent(t=t, kind="law", subject=name, text=f"{name}: {why}{IDLE}")
        for t, name in ((1.4, "inv1"), (1.2, "inv10"), (1.2, "inv2"))
    ]

    found = verdict(replace(ran().checked_case, events=tuple(events)), "law_failed")

    assert (found.status, found.count) == ("failed", 3)
    assert [(it.t, it.agent) for it in found.violations] == [(1.2, "inv2"), (1.2, "inv10"), (1.4, "inv1")]
    assert found.violations[0].text == why


def test_a_run_without_secondary_control_is_not_judged() -> None:
    """Droop alone has no law that could fail."""
    found = verdict(ran(case="I").checked_case, "law_failed")

    assert (found.status, found.reason) == ("not judged", "no inverter runs a law")
