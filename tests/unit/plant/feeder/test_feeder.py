"""The whole plant: rest, islanding, load loss, three islands, de-energised islands, re-closing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.feeder import Plant
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent
from gridpeers.plant.tables import read_feeder

T_C = 0.02


COUPLING = GfmDroop(R_f=0.0025, X_f=0.05)
"""The GFM impedance of the independent power flow: it decides how unbalanced the terminals are."""


def plant(*events: SwitchEvent, load_set: str = "main", record: float = T_C, **settings: Any) -> Plant:
    """Make the microgrid feeder with these switch operations."""
    network = Network(read_feeder("microgrid123", load_set))
    return Plant(network, PlantSettings(load_set=load_set, events=events, **settings), T_C, record)


def opened(t: float, *switches: str) -> tuple[SwitchEvent, ...]:
    return tuple(SwitchEvent(t=t, switch=name, action="open") for name in switches)


def run(p: Plant, until: float) -> None:
    while p.tick * T_C < until - 1e-9:
        p.advance()


def totals(p: Plant) -> tuple[float, float]:
    readings = p.measure().values()
    return sum(r.P for r in readings) / 1e3, sum(r.Q for r in readings) / 1e3


@pytest.mark.parametrize("model", ["voltage_source", "current_source"])
def test_the_feeder_rests(model: str) -> None:
    """On the real feeder nothing moves for 10 s without an event, and every V_set is exactly the scenario's."""
    p = plant(gfl=Gfl(model=model))
    first = p.measure()

    run(p, 10.0)

    for name, start in first.items():
        now = p.measure()[name]
        assert pytest.approx(start.P, abs=1e-6) == now.P
        assert pytest.approx(start.Q, abs=1e-6) == now.Q
        assert now.f == pytest.approx(60.0, abs=1e-9)
        assert now.V_set == pytest.approx(p.network.inverters[0].V_nom, rel=1e-9)
        assert now.grid_connected
        assert now.island == "grid"


@pytest.mark.parametrize(("load_set", "switches", "f", "P", "Q"), [
    ("main", ("13-152",), 59.8640, 3407.4, 1162.6),
    ("main", ("13-152", "60-160"), 60.0543, 2170.4, 498.7),
    ("event2", ("13-152",), 59.864, 3409.0, None),
    ("event2", ("13-152", "60-160"), 60.071, 2063.0, None),
])  # fmt: skip
def test_droop_alone_settles_where_the_power_flow_says(
    load_set: str, switches: tuple[str, ...], f: float, P: float, Q: float | None
) -> None:
    """The dynamics end at the steady states of an independent power flow of the same feeder."""
    p = plant(*opened(0.1, *switches), load_set=load_set, gfm=COUPLING)

    run(p, 6.0)
    kW, kvar = totals(p)

    assert p.measure()["inv1"].f == pytest.approx(f, abs=0.0006)
    assert kW == pytest.approx(P, abs=1.5)
    if Q is not None:
        assert kvar == pytest.approx(Q, abs=3.0)


def test_three_islands_each_at_their_own_frequency() -> None:
    """Two switches opened in one step leave three islands, each at the frequency of its own droop."""
    p = plant(*opened(0.1, "13-152"), *opened(2.0, "sw1_2", "sw2_3"), gfm=COUPLING)

    run(p, 8.0)
    now = p.measure()

    assert [now[name].f for name in ("inv1", "inv4", "inv7")] == pytest.approx([59.8147, 59.9340, 59.8435], abs=0.001)
    assert [now[name].island for name in p.inverters] == ["inv1"] * 3 + ["inv4"] * 3 + ["inv7"] * 3
    assert not any(reading.grid_connected for reading in now.values())


def test_a_gfl_alone_stops_and_comes_back() -> None:
    """A GFL cut off from every GFM delivers nothing; reconnected it ramps up again without an error."""
    network = Network(read_feeder("microgrid123", "main"))
    feeder = replace(
        network.feeder,
        inverters=tuple(unit for unit in network.inverters if unit.microgrid != "MG2" or unit.kind == "GFL"),
    )
    settings = PlantSettings(
        gfm=GfmDroop(I_max=1000.0),  # at 2 pu the island would collapse as it picks up the dead one
        events=(
            *opened(0.1, "13-152", "60-160"),
            *opened(0.5, "sw1_2", "sw2_3"),
            SwitchEvent(t=1.0, switch="sw1_2", action="close"),
        ),
    )
    p = Plant(Network(feeder), settings, T_C, T_C)

    run(p, 0.9)
    off = p.measure()["inv5"]
    run(p, 4.0)
    on = p.measure()["inv5"]

    assert (off.P, off.Q, off.V, off.f) == (0.0, 0.0, 0.0, 0.0)
    assert on.P > 150e3
    assert pytest.approx(2401.8, rel=0.05) == on.V


def test_both_gfl_representations_settle_alike() -> None:
    """Voltage-source and current-source GFL end at the same operating point on the feeder."""
    ends = []
    for model in ("voltage_source", "current_source"):
        p = plant(*opened(0.1, "13-152"), gfl=Gfl(model=model))
        run(p, 6.0)
        ends.append([(r.P, r.Q) for r in p.measure().values()])

    assert np.array(ends[0]) == pytest.approx(np.array(ends[1]), abs=50.0)


def test_rows_come_at_the_recording_step_and_an_event_between_ticks_acts_at_its_own() -> None:
    """A switch operated at 0.03 s, between two ticks of 0.02 s, shows in the row of 0.032 s and not before."""
    p = plant(*opened(0.03, "13-152"), record=0.002)

    run(p, 0.06)
    rows = p.take_rows()
    P = {round(row[0], 3): row[2] for row in rows}

    assert [row[0] for row in rows] == pytest.approx([0.002 * k for k in range(31)], abs=1e-12)
    assert p.take_rows() == ()
    assert P[0.03] == pytest.approx(P[0.0], abs=1e-3)
    assert abs(P[0.032] - P[0.03]) > 1e3


@pytest.mark.parametrize("name", ["inv1", "inv2"])
def test_an_inverter_leaves_and_comes_back_without_a_bump(name: str) -> None:
    """Taken off, an inverter delivers nothing and the others take over; put back, it starts at no load in step."""
    p = plant(*opened(0.1, "13-152", "60-160"))
    run(p, 3.0)
    before = p.measure()
    p.connect(name, on=False)
    run(p, 5.0)
    away = p.measure()
    p.take_rows()
    p.connect(name, on=True)
    p.advance()
    back = p.measure()
    run(p, 6.0)
    column = 2 + 6 * p.inverters.index(name)
    excursion = max(abs(row[column]) for row in p.take_rows())

    assert (away[name].P, away[name].Q) == (0.0, 0.0)
    assert sum(r.P for r in away.values()) == pytest.approx(sum(r.P for r in before.values()), rel=0.01)
    rating = next(unit.P_rated for unit in p.network.inverters if unit.name == name)
    assert excursion < 0.1 * rating
    assert abs(p.measure()[name].P) < 0.05 * rating, "its set-point is the one at which it rests"
    for other in p.inverters:
        if other != name:
            assert pytest.approx(away[other].P, rel=0.03) == back[other].P
    assert [event.text for event in p.take_events() if event.kind == "inverter"] == [
        f"{name} disconnected",
        f"{name} connected, at no load",
    ]


def test_a_switch_can_be_operated_by_hand() -> None:
    """Without a schedule a switch opens by a command, also by its alias; the answer says if it was already open."""
    p = plant(*opened(0.1, "13-152"))
    run(p, 1.0)

    already = [p.switch("67-67s", "close"), p.switch("sw1_2", "open"), p.switch("67s-67", "open")]
    p.advance()
    already.append(p.switch("sw1_2", "open"))

    assert already == [True, False, True, True], "what was told for the same step counts too"
    assert p.measure()["inv1"].island == "inv1"
    assert p.measure()["inv4"].island == "inv4"


def test_a_spare_is_off_until_it_is_connected() -> None:
    """A spare inverter changes nothing while it is off, and shares the load once it is on and has set-points."""
    events = opened(0.1, "13-152")
    bare = plant(*events)
    feeder = read_feeder("microgrid123", "main")
    spared = Plant(Network(feeder, spares=["inv10"]), PlantSettings(events=events, spares=("inv10",)), T_C, T_C)

    run(bare, 2.0)
    run(spared, 2.0)
    off = spared.measure()
    spared.connect("inv10", on=True)
    spared.hold("inv10", 200e3, off["inv9"].V_set)
    run(spared, 4.0)

    assert "inv10" not in bare.measure()
    assert off["inv10"].P == 0.0
    for name, reading in bare.measure().items():
        assert pytest.approx(off[name].P, rel=1e-9) == reading.P
    assert spared.measure()["inv10"].P > 150e3
    assert spared.measure()["inv1"].f > off["inv1"].f + 0.01


def test_parts_that_are_de_energised_from_the_start_are_reported() -> None:
    """An inverter cut off before the run begins is an event at t = 0, with its load, not a silent zero."""
    feeder = read_feeder("microgrid123", "main")
    cut = replace(feeder, lines=tuple(line for line in feeder.lines if "162" not in (line.from_bus, line.to_bus)))
    lone = replace(cut, inverters=tuple(unit for unit in cut.inverters if unit.name != "inv1"))

    (event,) = Plant(Network(lone), PlantSettings(), T_C, T_C).take_events()

    assert (event.t, event.kind) == (0.0, "dead")
    assert "1 bus (162)" in event.text
    assert "inv3 idle" in event.text


def test_the_grid_takes_back_an_island_out_of_phase() -> None:
    """Two and a half seconds of droop put the island 122 degrees behind; closed so, it is pulled back into step."""
    p = plant(*opened(0.1, "13-152"), SwitchEvent(t=2.5, switch="13-152", action="close"))

    run(p, 6.0)

    assert [event for event in p.take_events() if event.kind == "trip"] == []
    assert [r.f for r in p.measure().values()] == pytest.approx([60.0] * 9, abs=1e-3)
    assert np.isfinite(p.take_rows()).all()


def test_an_overloaded_island_trips_and_the_rest_goes_on() -> None:
    """With more load than its ratings, the island is de-energised with a reason; the run reaches its end."""
    feeder = read_feeder("microgrid123")
    loads = tuple(replace(load, S=tuple(2.0 * S for S in load.S)) for load in feeder.loads)
    settings = PlantSettings(events=opened(0.1, "13-152"))
    p = Plant(Network(replace(feeder, loads=loads)), settings, T_C, T_C)

    run(p, 1.0)

    events = p.take_events()
    (trip,) = [event for event in events if event.kind == "trip"]
    assert "inv9 tripped, as the island has no solution: overload, " in trip.text
    assert "6864 kW of load on inverters of 3900 kVA" in trip.text
    assert [event.kind for event in events][-2:] == ["trip", "dead"]
    assert all((r.P, r.V, r.grid_connected) == (0.0, 0.0, False) for r in p.measure().values())
    assert np.isfinite(p.take_rows()).all()
