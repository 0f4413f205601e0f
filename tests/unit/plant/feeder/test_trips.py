"""Protection in the plant: who trips at which step, dead islands, and the way back."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.dynamics.switching import Trip
from gridpeers.plant.equipment.inverter_parameters import GfmParameters
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.islands import trip_event
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, PowerLimit, Protection, SwitchEvent
from gridpeers.plant.tables import read_feeder
from gridpeers.wire.messages import OFF, PlantEvent
from tests.unit.plant.feeder.test_feeder import T_C, opened, run

UNLIMITED = GfmParameters(I_max=1000.0)
"""GFM of any current: overloads, and black starts into the whole load, come to the functions that are tested here."""

CLOUDS = tuple(PowerLimit(t=1.5, inverter=f"inv{k}", P_max=0.0) for k in (2, 3, 5, 6, 8, 9))
"""No GFL has any power from 1.5 s on."""


def plant(
    protection: Protection, *events: SwitchEvent, limits: tuple[PowerLimit, ...] = (), load_set: str = "event2"
) -> Plant:
    """Make the microgrid feeder with this protection."""
    settings = PlantSettings(load_set=load_set, events=events, limits=limits, protection=protection, gfm=UNLIMITED)
    return Plant(Network(read_feeder("microgrid123", load_set)), settings, T_C, 0.002)


def trips(events: tuple[PlantEvent, ...]) -> list[PlantEvent]:
    """Pick the events of protection."""
    return [event for event in events if event.kind == "trip"]


def history(p: Plant) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], ...]:
    """Give t (s), and f (Hz), P (W), V (V) of every inverter, as recorded."""
    rows = np.array(p.take_rows())
    return rows[:, 0], rows[:, 1::6], rows[:, 2::6], rows[:, 4::6]


@pytest.mark.parametrize("category", ["off", "III"])
def test_underfrequency_trips_before_the_frequency_is_nonsense(category: str) -> None:
    """Three GFM alone with 3430 kW fall far below 56.5 Hz without protection; with it they trip 0.16 s after that."""
    p = plant(Protection(category="off" if category == "off" else "III"), *opened(1.0, "13-152"), limits=CLOUDS)

    run(p, 3.0)

    t, f, _, V = history(p)
    live = V > 0.0
    if category == "off":
        assert f[live].min() < 50.0
        assert not trips(p.take_events())
        return
    told = trips(p.take_events())
    assert [event.subject for event in told if "underfrequency" in event.text]
    first = told[0]
    below = t[(f[:, 0] < 56.5) & live[:, 0]]
    assert first.t == pytest.approx(below[0] + 79 * 0.002, abs=1e-9)
    assert "UF2: 56.5 Hz" in first.text
    assert f[live].min() > 54.0
    assert np.isfinite(f).all()


def test_a_trip_acts_at_its_very_step() -> None:
    """The clearing time ends within a control period: the row of that step has power, the next one has none."""
    p = plant(Protection(), *opened(1.0, "13-152"), limits=CLOUDS)

    run(p, 3.0)

    t, _, P, _ = history(p)
    first = trips(p.take_events())[0]
    k = int(np.argmin(np.abs(t - first.t)))
    assert round(first.t / 0.002) % round(T_C / 0.002) != 0
    assert np.all(P[k] != 0.0)
    assert np.all(P[k + 1] == 0.0)


def test_a_dead_island_has_no_frequency_and_its_inverters_no_island() -> None:
    """After a blackout every inverter reads 0 V, 0 W, 0 Hz, and is told that it is out of service; the run goes on."""
    p = plant(Protection(), *opened(1.0, "13-152"))
    run(p, 2.0)

    p.connect("inv1", False)
    p.connect("inv4", False)
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


def test_leaders_that_return_start_a_dead_island_with_all_that_tripped_there() -> None:
    """After load is switched off, inv1 and inv4 come back, and the island is started when all have waited 1 s."""
    p = plant(Protection(enter_service=1.0), *opened(1.0, "13-152"), *opened(2.2, "60-160"))
    run(p, 2.0)
    p.connect("inv1", False)
    p.connect("inv4", False)
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
    p = plant(Protection(enter_service=0.2), *opened(1.0, "13-152"))
    run(p, 2.0)
    p.connect("inv1", False)
    p.connect("inv4", False)

    run(p, 6.0)

    told = [event.text for event in trips(p.take_events())]
    assert sum(text.startswith("black start") for text in told) == 2
    assert sum("3 times" in text for text in told) == 1
    assert {r.V for r in p.measure().values()} == {0.0}


def test_who_left_does_not_come_back_by_itself() -> None:
    """An inverter whose agent left after a trip waits for nobody; the others start without it."""
    p = plant(Protection(enter_service=1.0), *opened(1.0, "13-152"), *opened(2.2, "60-160"))
    run(p, 2.0)
    p.connect("inv1", False)
    p.connect("inv4", False)
    run(p, 2.1)
    p.connect("inv2", False)
    p.connect("inv1", True)
    p.connect("inv4", True)

    run(p, 5.0)

    on = {name for name, reading in p.measure().items() if reading.P != 0.0}
    assert on == {f"inv{k}" for k in (1, 3, 4, 5, 6, 7, 8, 9)}


def test_an_island_without_solution_takes_no_other_with_it(network: Network) -> None:
    """Where a closing lets one of two live islands collapse, only its own inverters trip."""
    actions = ((1.0, "13-152", "open"), (1.5, "60-160", "open"), (1.62, "sw1_2", "open"), (1.88, "60-160", "close"))
    events = tuple(SwitchEvent(t=t, switch=switch, action=action) for t, switch, action in actions)
    p = Plant(network, PlantSettings(events=events), T_C, T_C)

    run(p, 2.2)

    tripped = [event.text for event in trips(p.take_events())]
    assert len(tripped) == 1
    assert tripped[0].startswith("inv1, inv2, inv3 tripped, as the island has no solution")


def test_generation_beyond_the_load_is_no_collapse_under_load() -> None:
    """Where nothing takes what is generated, the trip says so, without a voltage that no network has."""
    feeder = read_feeder("microgrid123")
    loads = tuple(replace(load, S=(-load.S[0], -load.S[1], -load.S[2])) for load in feeder.loads)
    network = Network(replace(feeder, loads=loads, source=None))
    trip = Trip(step=0, inverters=(0,), substation=False, V_min=8e8)

    text = trip_event(1.0, trip, network, frozenset(row.name for row in feeder.switches), ()).text

    assert text.endswith("no solution: constant generation of 4192 kW more than the load")
