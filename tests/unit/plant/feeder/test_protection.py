"""Trip functions and the return to service, on traces of frequency and voltage alone."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.feeder.protection import ATTEMPTS, Recovery, Relays, Tripped
from gridpeers.plant.known_names import DEFAULTS
from gridpeers.plant.plant_config import Protection

H = 0.002
ON = np.array([True])
SETTINGS = [(category, name) for category in DEFAULTS for name in DEFAULTS[category]]


def row(value: float) -> NDArray[np.float64]:
    """One step of one inverter."""
    return np.array([[value]])


def chosen(category: str) -> Protection:
    """Give a category's default settings."""
    return Protection(category="II" if category == "II" else "III")


def steps_until_trip(relays: Relays, *, f: float = 60.0, low: float = 1.0, high: float = 1.0, most: int) -> int:
    """Steps for which a condition must hold until something trips; 0 if nothing does."""
    for k in range(most):
        if relays.watch(row(f), row(low), row(high), ON):
            return k + 1
    return 0


def beyond(name: str, threshold: float) -> dict[str, float]:
    """Give the measured value just beyond a function's threshold."""
    value = threshold + (1e-6 if name[0] == "O" else -1e-6)
    if name[1] == "F":
        return {"f": value}
    return {"high": value} if name[0] == "O" else {"low": value}


@pytest.mark.parametrize(("category", "name"), SETTINGS)
def test_each_function_trips_after_its_clearing_time_and_not_a_step_before(category: str, name: str) -> None:
    """Tables 12, 13 and 18 of IEEE 1547-2018: beyond the threshold for the clearing time, to the step."""
    threshold, time = DEFAULTS[category][name]
    h = H if time < 5.0 else 0.1
    relays = Relays(chosen(category), 1, h, 60.0)

    assert steps_until_trip(relays, **beyond(name, threshold), most=round(400.0 / h)) == round(time / h)


def test_a_setting_of_a_scenario_in_hertz_is_taken_as_it_stands() -> None:
    """At 50 Hz the standard's defaults are in proportion; what somebody writes is meant in Hz."""
    relays = Relays(Protection(trips={"OF2": (51.5, 0.1)}), 1, H, 50.0)
    at = dict(zip(relays.names, relays.thresholds.tolist(), strict=True))

    assert at["OF2"] == 51.5
    assert at["OF1"] == pytest.approx(51.0)
    assert at["UV1"] == 0.88


@pytest.mark.parametrize(("category", "name"), SETTINGS)
def test_at_its_threshold_no_function_trips(category: str, name: str) -> None:
    """The threshold itself is not beyond it, however long it lasts; the other functions are out of the way."""
    threshold, time = DEFAULTS[category][name]
    away = {other: (1e3 if other[0] == "O" else -1.0, 1e3) for other in DEFAULTS[category] if other != name}
    relays = Relays(replace(chosen(category), trips=away), 1, 0.1, 60.0)
    at = dict.fromkeys(beyond(name, threshold), threshold)

    assert steps_until_trip(relays, **at, most=round(time / 0.1) + 2) == 0


def test_a_step_back_within_the_threshold_starts_the_clearing_time_anew() -> None:
    """A sag of 79 steps, one step of normal voltage and 79 steps of sag do not trip a function of 80 steps."""
    relays = Relays(Protection(category="II"), 1, H, 60.0)

    assert steps_until_trip(relays, low=0.4, most=79) == 0
    assert relays.quiet == 1
    assert steps_until_trip(relays, low=1.0, most=1) == 0
    assert relays.quiet == 80
    assert steps_until_trip(relays, low=0.4, most=79) == 0
    assert steps_until_trip(relays, low=0.4, most=1) == 1


def test_many_steps_at_once_are_the_same_as_one_by_one() -> None:
    """A trace cut at random, never longer than `quiet`, trips at the same step as one of single steps."""
    rng = np.random.default_rng(1)
    low = np.where(rng.random((4000, 3)) < 0.99, 0.4, 1.0)
    f, high, on = np.full_like(low, 60.0), np.ones_like(low), np.ones(3, bool)
    single, cut = Relays(Protection(category="II"), 3, H, 60.0), Relays(Protection(category="II"), 3, H, 60.0)
    one_by_one = [
        (k + 1, t) for k in range(4000) for t in single.watch(f[k : k + 1], low[k : k + 1], high[k : k + 1], on)
    ]

    found: list[tuple[int, Tripped]] = []
    k = 0
    while k < 4000:
        n = min(int(rng.integers(1, 40)), cut.quiet, 4000 - k)
        found += [(k + n, t) for t in cut.watch(f[k : k + n], low[k : k + n], high[k : k + n], on)]
        k += n

    assert one_by_one
    assert found == one_by_one


def test_an_inverter_that_is_off_does_not_trip() -> None:
    """An inverter that delivers nothing, or stands in a dead island, is not tripped."""
    relays = Relays(Protection(), 1, H, 60.0)

    assert not any(relays.watch(row(60.0), row(0.0), row(0.0), np.array([False])) for _ in range(2000))


def test_settings_of_a_scenario_go_before_the_defaults_and_off_is_off() -> None:
    """UV2 at 0.8 pu for 0.1 s trips where the default does not; category "off" never trips."""
    own = Relays(Protection(trips={"UV2": (0.8, 0.1)}), 1, H, 60.0)
    off = Relays(Protection(category="off", trips={"UV2": (0.8, 0.1)}), 1, H, 60.0)

    assert steps_until_trip(own, low=0.75, most=100) == 50
    assert steps_until_trip(off, f=20.0, low=0.0, most=100) == 0


def test_frequency_settings_follow_the_nominal_frequency() -> None:
    """At 50 Hz UF2 is at 47.08 Hz, as 56.5 Hz is at 60 Hz."""
    relays = Relays(Protection(), 1, H, 50.0)

    assert steps_until_trip(relays, f=47.10, most=200) == 0
    assert steps_until_trip(relays, f=47.07, most=200) == 80


def wait(
    recovery: Recovery, steps: int, *, f: float = 60.0, low: float = 1.0, high: float = 1.0, dead: bool = False
) -> None:
    """Let steps go by."""
    trace = np.ones((steps, 1))
    recovery.watch(f * trace, low * trace, high * trace, np.array([dead]))


@pytest.mark.parametrize(
    ("seen", "enters"),
    [
        ({}, True),
        ({"low": 0.917, "high": 1.05, "f": 60.1}, True),
        ({"low": 0.916}, False),
        ({"high": 1.051}, False),
        ({"f": 59.49}, False),
        ({"f": 60.11}, False),
    ],
)
def test_an_inverter_enters_service_after_the_delay_with_normal_voltage_and_frequency(
    seen: dict[str, float], enters: bool
) -> None:
    """IEEE 1547-2018, 4.10: all phases within 0.917 to 1.05 pu and 59.5 to 60.1 Hz for the delay, without a break."""
    recovery = Recovery(2.0, 1, H, 60.0)
    recovery.trip(0)

    wait(recovery, 999, **seen)
    assert not recovery.passed(0)
    assert recovery.quiet == (1 if enters else 1000)
    wait(recovery, 1, **seen)

    assert recovery.passed(0) == enters


def test_a_disturbance_while_waiting_starts_the_delay_anew() -> None:
    """A step of low voltage after 1.9 s of a delay of 2 s costs another 2 s."""
    recovery = Recovery(2.0, 1, H, 60.0)
    recovery.trip(0)

    wait(recovery, 950)
    wait(recovery, 1, low=0.5)
    wait(recovery, 999)
    assert not recovery.passed(0)
    wait(recovery, 1)

    assert recovery.passed(0)


def test_in_a_dead_island_the_delay_counts_from_the_trip() -> None:
    """Where there is nothing to measure the delay passes all the same; when voltage comes it begins anew."""
    recovery = Recovery(2.0, 1, H, 60.0)
    recovery.trip(0)

    wait(recovery, 1000, f=0.0, low=0.0, high=0.0, dead=True)
    assert recovery.passed(0)
    wait(recovery, 10)

    assert not recovery.passed(0)


def test_who_trips_again_and_again_stays_off() -> None:
    """The third trip without a minute in service between locks out; an agent that joins anew unlocks."""
    recovery = Recovery(2.0, 1, H, 60.0)

    for _ in range(ATTEMPTS - 1):
        assert not recovery.trip(0)
        wait(recovery, 1000)
        recovery.enter(0)
        wait(recovery, 1000)
    assert recovery.trip(0)
    assert recovery.locked[0]
    recovery.unlock(0)

    assert not recovery.locked[0]


def test_trips_far_apart_are_not_counted_together() -> None:
    """After a minute in service an inverter may trip and come back as often as at first."""
    recovery = Recovery(2.0, 1, 0.1, 60.0)

    for _ in range(3 * ATTEMPTS):
        assert not recovery.trip(0)
        wait(recovery, 20)
        recovery.enter(0)
        wait(recovery, 600)
