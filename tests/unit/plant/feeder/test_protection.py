"""Trips of inverters and their return to service: IEEE 1547-2018."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.dynamics.simulation import Trip
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.islands import trip_event
from gridpeers.plant.feeder.protection import ATTEMPTS, Recovery, Relays, Tripped
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.known_names import DEFAULTS
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, PowerLimit, Protection, SwitchEvent
from gridpeers.plant.tables import read_feeder
from gridpeers.wire.messages import OFF, PlantEvent
from tests.unit.plant.feeder import test_feeder
from tests.unit.plant.feeder.test_feeder import T_C, opened, run

H = 0.002
ON = np.array([True])
SETTINGS = [(category, name) for category in DEFAULTS for name in DEFAULTS[category]]


def row(value: float) -> NDArray[np.float64]:
    return np.array([[value]])


def steps_until_trip(relays: Relays, *, f: float = 60.0, low: float = 1.0, high: float = 1.0, most: int) -> int:
    """Steps for which a condition must hold until something trips; 0 if nothing does."""
    for k in range(most):
        if relays.watch(row(f), row(low), row(high), ON):
            return k + 1
    return 0


@pytest.mark.parametrize(("category", "name"), SETTINGS)
def test_each_function_trips_beyond_its_threshold_after_its_clearing_time(
    category: Literal["II", "III"], name: str
) -> None:
    """Tables 12, 13 and 18 of IEEE 1547-2018, to the step; at the threshold itself it does not trip."""
    threshold, time = DEFAULTS[category][name]
    quantity = "f" if name[1] == "F" else "high" if name[0] == "O" else "low"
    beyond = threshold + (1e-6 if name[0] == "O" else -1e-6)
    h = H if time < 5.0 else 0.1
    away = {other: (1e3 if other[0] == "O" else -1.0, 1e3) for other in DEFAULTS[category] if other != name}
    alone = Relays(Protection(category=category, trips=away), 1, 0.1, 60.0)

    relays = Relays(Protection(category=category), 1, h, 60.0)

    assert steps_until_trip(relays, **{quantity: beyond}, most=round(400.0 / h)) == round(time / h)
    assert steps_until_trip(alone, **{quantity: threshold}, most=round(time / 0.1) + 2) == 0


def test_settings_of_a_scenario_replace_defaults_that_follow_the_nominal_frequency() -> None:
    """At 50 Hz the default of UF2 is 47.08 Hz; a setting of the scenario is in Hz; "off" disables all."""
    own = Relays(Protection(trips={"UV2": (0.8, 0.1), "OF2": (51.5, 0.1)}), 1, H, 50.0)
    off = Relays(Protection(category="off", trips={"UV2": (0.8, 0.1)}), 1, H, 60.0)
    at = dict(zip(own.names, own.thresholds.tolist(), strict=True))

    assert at["OF2"] == 51.5
    assert at["OF1"] == pytest.approx(51.0)
    assert at["UV1"] == 0.88
    assert steps_until_trip(own, f=50.0, low=0.75, most=100) == 50
    assert steps_until_trip(own, f=47.10, most=200) == 0
    assert steps_until_trip(own, f=47.07, most=200) == 80
    assert steps_until_trip(off, f=20.0, low=0.0, most=100) == 0


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
    """An inverter without power, or in a de-energised island, is not tripped."""
    relays = Relays(Protection(), 1, H, 60.0)

    assert not any(relays.watch(row(60.0), row(0.0), row(0.0), np.array([False])) for _ in range(2000))


def wait(
    recovery: Recovery, steps: int, *, f: float = 60.0, low: float = 1.0, high: float = 1.0, dead: bool = False
) -> None:
    trace = np.ones((steps, 1))
    recovery.watch(f * trace, low * trace, high * trace, np.array([dead]))


@pytest.mark.parametrize(("seen", "enters"), [
    ({}, True),
    ({"low": 0.917, "high": 1.05, "f": 60.1}, True),
    ({"low": 0.916}, False),
    ({"high": 1.051}, False),
    ({"f": 59.49}, False),
    ({"f": 60.11}, False),
])  # fmt: skip
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


def test_a_disturbance_and_a_change_of_the_island_start_the_delay_anew() -> None:
    """In a de-energised island, where there is nothing to measure, it counts from the trip."""
    recovery = Recovery(2.0, 1, H, 60.0)
    recovery.trip(0)

    wait(recovery, 950)
    wait(recovery, 1, low=0.5)
    wait(recovery, 999)
    assert not recovery.passed(0)
    wait(recovery, 1)
    assert recovery.passed(0)
    wait(recovery, 1000, f=0.0, low=0.0, high=0.0, dead=True)
    assert recovery.passed(0)
    wait(recovery, 10)
    assert not recovery.passed(0)


@pytest.mark.parametrize(("served", "locks"), [(2.0, True), (60.0, False)])
def test_an_inverter_that_trips_three_times_stays_off(served: float, locks: bool) -> None:
    """The third trip without a minute in service between locks out; an agent that joins anew unlocks."""
    recovery = Recovery(2.0, 1, 0.1, 60.0)

    for _ in range(ATTEMPTS - 1):
        assert not recovery.trip(0)
        wait(recovery, 20)
        recovery.enter(0)
        wait(recovery, round(served / 0.1))
    assert recovery.trip(0) == locks == recovery.locked[0]
    recovery.unlock(0)

    assert not recovery.locked[0]


UNLIMITED = GfmDroop(I_max=1000.0)
"""GFM of any current: overloads, and black starts into the whole load, come to the functions that are tested here."""

CLOUDS = tuple(PowerLimit(t=1.5, inverter=f"inv{k}", P_max=0.0) for k in (2, 3, 5, 6, 8, 9))
"""No GFL has any power from 1.5 s on."""


def plant(protection: Protection, *events: SwitchEvent, limits: tuple[PowerLimit, ...] = ()) -> Plant:
    """Make the microgrid feeder with this protection."""
    own: dict[str, Any] = {"protection": protection, "limits": limits, "gfm": UNLIMITED}
    return test_feeder.plant(*events, load_set="event2", record=0.002, **own)


def trips(events: tuple[PlantEvent, ...]) -> list[PlantEvent]:
    return [event for event in events if event.kind == "trip"]


def history(p: Plant) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], ...]:
    """Give t (s), and f (Hz), P (W), V (V) of every inverter, as recorded."""
    rows = np.array(p.take_rows())
    return rows[:, 0], rows[:, 1::6], rows[:, 2::6], rows[:, 4::6]


def blackout(protection: Protection, *events: SwitchEvent) -> Plant:
    """The feeder, islanded at 1 s, whose leaders inv1 and inv4 go at 2 s: what is left cannot feed it."""
    p = plant(protection, *opened(1.0, "13-152"), *events)
    run(p, 2.0)
    p.connect("inv1", False)
    p.connect("inv4", False)
    return p


def test_underfrequency_trips_at_the_very_step_and_without_protection_never() -> None:
    """Three GFM alone with 3430 kW fall far below 56.5 Hz; 0.16 s later, within a control period, power is 0."""
    off, on = (plant(Protection(category=it), *opened(1.0, "13-152"), limits=CLOUDS) for it in ("off", "III"))  # type: ignore[arg-type]
    for p in (off, on):
        run(p, 3.0)

    _, f, _, V = history(off)
    assert f[V > 0.0].min() < 50.0
    assert not trips(off.take_events())
    t, f, P, V = history(on)
    first, *_ = told = trips(on.take_events())
    assert [event.subject for event in told if "underfrequency" in event.text]
    assert "UF2: 56.5 Hz" in first.text
    below = t[(f[:, 0] < 56.5) & (V[:, 0] > 0.0)]
    assert first.t == pytest.approx(below[0] + 79 * 0.002, abs=1e-9)
    assert f[V > 0.0].min() > 54.0
    assert np.isfinite(f).all()
    k = int(np.argmin(np.abs(t - first.t)))
    assert round(first.t / 0.002) % round(T_C / 0.002) != 0
    assert np.all(P[k] != 0.0)
    assert np.all(P[k + 1] == 0.0)


def test_a_de_energised_island_has_no_frequency_and_its_inverters_no_island() -> None:
    """After a blackout every inverter measures 0 V, 0 W, 0 Hz, and is out of service; the run continues."""
    p = blackout(Protection())
    run(p, 4.0)

    assert {(r.f, r.P, r.Q, r.V, r.island) for r in p.measure().values()} == {(0.0, 0.0, 0.0, 0.0, OFF)}
    assert [event.kind for event in p.take_events() if event.kind in ("trip", "dead")] == ["trip", "dead"]


def test_an_inverter_that_tripped_alone_comes_back_at_no_load_after_the_delay() -> None:
    """inv2 takes vars until its own voltage is below a narrow setting; the island goes on, and 1 s later it is back."""
    p = plant(Protection(trips={"UV1": (0.9416, 0.5)}, enter_service=1.0), *opened(1.0, "13-152"))
    run(p, 2.0)
    for _ in range(100):
        p.hold("inv2", 200e3, 1900.0)
        p.advance()
        if told := trips(p.take_events()):
            break
    assert [event.subject for event in told] == ["inv2"]
    p.take_rows()
    gone = told[0].t
    p.hold("inv2", 200e3, 1900.0)
    off = p.measure()
    assert off["inv2"].island == OFF
    assert off["inv1"].island == "inv1"

    run(p, gone + 1.5)

    (back,) = trips(p.take_events())
    t, f, P, _ = history(p)
    start = int(np.argmin(np.abs(t - back.t)))
    assert gone + 1.0 - 1e-9 <= back.t < gone + 1.2
    assert np.all(P[:start, 1] == 0.0)
    assert np.abs(P[start + 4 : start + 14, 1]).max() < 25e3  # the first 6 ms are the current controller's own
    assert p.measure()["inv2"].island == "inv1"
    assert np.abs(f[start:, 0] - 60.0).max() < 0.5


def test_leaders_that_return_start_a_de_energised_island_with_all_that_tripped_there() -> None:
    """After load is switched off, inv1 and inv4 come back, and the island is started when all have waited 1 s."""
    p = blackout(Protection(enter_service=1.0), *opened(2.2, "60-160"))
    run(p, 2.5)
    p.connect("inv1", True)
    p.connect("inv4", True)
    p.take_events()

    run(p, 5.0)

    events = p.take_events()
    assert [event.subject for event in events if event.kind == "inverter"] == ["inv1", "inv4"]
    assert {r.island for r in p.measure().values()} == {"inv1"}
    assert sum(r.P for r in p.measure().values()) == pytest.approx(2060e3, rel=0.02)
    assert all(59.5 < r.f < 60.1 for r in p.measure().values())


def test_an_island_that_cannot_carry_its_load_is_not_started_for_ever() -> None:
    """The remaining inverters try twice more; then they stay off until another joins."""
    p = blackout(Protection(enter_service=0.2))

    run(p, 6.0)

    told = [event.text for event in trips(p.take_events())]
    assert sum(text.startswith("black start") for text in told) == 2
    assert sum("3 times" in text for text in told) == 1
    assert {r.V for r in p.measure().values()} == {0.0}


def test_an_inverter_whose_agent_left_does_not_return_by_itself() -> None:
    """After a trip its agent leaves, and the others start without it."""
    p = blackout(Protection(enter_service=1.0), *opened(2.2, "60-160"))
    run(p, 2.1)
    p.connect("inv2", False)
    p.connect("inv1", True)
    p.connect("inv4", True)

    run(p, 5.0)

    on = {name for name, reading in p.measure().items() if reading.P != 0.0}
    assert on == {f"inv{k}" for k in (1, 3, 4, 5, 6, 7, 8, 9)}


def test_an_island_without_solution_does_not_affect_the_others(network: Network) -> None:
    """If one of two live islands collapses after a closing, only its own inverters trip."""
    actions = ((1.0, "13-152", "open"), (1.5, "60-160", "open"), (1.62, "sw1_2", "open"), (1.88, "60-160", "close"))
    events = tuple(SwitchEvent(t=t, switch=switch, action=action) for t, switch, action in actions)
    p = Plant(network, PlantSettings(events=events), T_C, T_C)

    run(p, 2.2)

    tripped = [event.text for event in trips(p.take_events())]
    assert len(tripped) == 1
    assert tripped[0].startswith("inv1, inv2, inv3 tripped, as the island has no solution")


def test_generation_beyond_the_load_is_no_collapse_under_load() -> None:
    """The trip names the surplus of generation, without an unreal voltage."""
    feeder = read_feeder("microgrid123")
    loads = tuple(replace(load, S=(-load.S[0], -load.S[1], -load.S[2])) for load in feeder.loads)
    network = Network(replace(feeder, loads=loads, source=None))
    trip = Trip(step=0, inverters=(0,), substation=False, V_min=8e8)

    text = trip_event(1.0, trip, network, frozenset(row.name for row in feeder.switches), ()).text

    assert text.endswith("no solution: constant generation of 4192 kW more than the load")
