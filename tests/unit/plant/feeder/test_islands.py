"""Islands of a feeder: their circuits, names and events, also under random switching."""

from __future__ import annotations

import random
from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.dynamics.reduction import Reduction
from gridpeers.plant.equipment import InverterRow, Switch
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.circuits import Circuits
from gridpeers.plant.feeder.islands import Islands
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import Method, PlantSettings, Protection, SwitchEvent
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.networks import PAPER_ISLANDS, feeder, opened, three_phase_bus


def reduced(network: Network, closed: frozenset[str], *, off: tuple[str, ...] = ()) -> Reduction:
    """The reduction of a switch state, with some inverters disconnected."""
    units = network.inverters
    return Reduction(
        Circuits(network).of(closed),
        np.full(len(units), 0.1 - 1.0j),
        np.array([unit.kind == "GFM" for unit in units]),
        np.array([unit.name not in off for unit in units]),
    )


def test_islands_are_named_by_their_first_inverter(network: Network) -> None:
    """The island that the substation feeds is "grid"; any other has the name of its first inverter."""
    islands = Islands(network)

    whole, fed = islands.names(reduced(network, network.closed0))
    parts, alone = islands.names(reduced(network, opened(network, *PAPER_ISLANDS)))

    assert (set(whole), all(fed)) == ({"grid"}, True)
    assert parts == ["inv1"] * 3 + ["inv4"] * 3 + ["inv7"] * 3
    assert not any(alone)


def test_an_unchanged_island_is_reported_once(network: Network) -> None:
    """A switch that only drops load changes no island; the split of one island does not report another."""
    whole, parts = opened(network, "13-152"), opened(network, "13-152", "sw1_2")
    islands = Islands(network)

    first, again, then = (islands.report(1.0, closed, reduced(network, closed)) for closed in (whole, whole, parts))

    assert [event.subject for event in first] == ["inv1"]
    assert again == []
    assert [event.subject for event in then] == ["inv1", "inv4"]


def test_an_island_without_gfm_is_de_energised_and_reported_once(network: Network) -> None:
    """Buses without GFM are reported with load and idle inverters, once until they are energised again."""
    closed = opened(network, *PAPER_ISLANDS)
    dead, alive = reduced(network, closed, off=("inv4",)), reduced(network, closed)
    islands = Islands(network)

    first, again, fed, last = (islands.report_dead(1.0, closed, state) for state in (dead, dead, alive, dead))

    (event,) = first
    assert (event.kind, again, fed) == ("dead", [], [])
    assert event.text.startswith("de-energised: ")
    assert "without substation or GFM, 985 kW of load not served, inv4, inv5, inv6 idle" in event.text
    assert last == first


T_C, H, END = 0.02, 0.002, 2.0
SWITCHES = ("13-152", "60-160", "sw1_2", "sw2_3")
BAND = {"off": (25.0, 95.0), "III": (54.0, 63.0)}
"""Frequencies (Hz) of connected inverters. Without protection a GFM can have 60 and its limiters' bound, 200 rad/s, and
a bit for the droop; with it, what lies 0.16 s beyond 56.5 and 62 Hz."""

NO_SOLUTION = ("overload", "out of phase", "voltage collapse")
PROTECTION = ("voltage", "frequency")


def schedule(draw: random.Random) -> tuple[SwitchEvent, ...]:
    """Six to twelve switchings; the first islands the feeder, else nothing much happens."""
    first = SwitchEvent(t=0.1, switch="13-152", action="open")
    rest = [
        SwitchEvent(
            t=round(draw.randrange(round(0.2 / H), round(END / H)) * H, 9),
            switch=draw.choice(SWITCHES),
            action=draw.choice(("open", "close")),
            synchronised=draw.random() < 0.2,
        )
        for _ in range(draw.randint(5, 11))
    ]
    return first, *sorted(rest, key=lambda event: event.t)


@pytest.mark.parametrize(
    ("category", "seed", "method"), [("off", 0, "first-order"), ("III", 0, "first-order"), ("III", 1, "second-order")]
)
def test_no_schedule_of_switching_ends_the_plant(category: Literal["off", "III"], seed: int, method: Method) -> None:
    """Every row is finite; a connected inverter has a bounded frequency, another has no power; trips are events."""
    draw = random.Random(f"switchings {seed}")
    factor = draw.uniform(0.8, 2.0)
    feeder = read_feeder("microgrid123")
    loads = tuple(replace(load, S=tuple(factor * S for S in load.S)) for load in feeder.loads)
    settings = PlantSettings(events=schedule(draw), h=H, method=method, protection=Protection(category=category))
    plant = Plant(Network(replace(feeder, loads=loads)), settings, T_C, T_C)
    low, high = BAND[category]
    causes = NO_SOLUTION if category == "off" else (*NO_SOLUTION, *PROTECTION)

    events, off = [], set[str]()
    for _ in range(round(END / T_C)):
        plant.advance()
        new = plant.take_events()
        events += new
        off.update(
            name for event in new if event.kind in ("trip", "dead") for name in plant.inverters if name in event.text
        )
        for name, reading in plant.measure().items():
            assert np.isfinite([reading.P, reading.Q, reading.V, reading.f]).all()
            if reading.P or reading.Q:
                assert low < reading.f < high
            else:
                assert name in off

    assert np.isfinite(np.array(plant.take_rows())).all()
    for trip in (event for event in events if event.kind == "trip"):
        assert any(cause in trip.text for cause in causes)


def inverter(name: str, bus: str) -> InverterRow:
    return InverterRow(name=name, kind="GFM", bus=bus, microgrid="MG1", P_rated=600e3, V_nom=2400.0, m_p=0.01, m_q=0.05)


def test_a_switch_state_has_one_circuit(network: Network) -> None:
    """Coming back to a switch state gives the very circuit it had, so its factors are found again."""
    circuits = Circuits(network)
    first = circuits.of(network.closed0)

    assert circuits.of(opened(network, *PAPER_ISLANDS)) is not first
    assert circuits.of(frozenset(set(network.closed0))) is first


def test_inverters_tied_without_impedance_are_refused() -> None:
    """A closed switch between two inverters leaves their sharing undecided, and the error names both."""
    network = Network(
        feeder(
            buses=(three_phase_bus("1"), three_phase_bus("2")),
            switches=(Switch(name="1-2", alias="", from_bus="1", to_bus="2", phases="ABC", closed=True),),
            inverters=(inverter("inv1", "1"), inverter("inv2", "2")),
        )
    )

    with pytest.raises(PlantError, match="inv2 at bus 2 is tied to inv1 by closed switches"):
        Circuits(network).of(network.closed0)
    assert len(Circuits(network).of(frozenset()).terminals) == 2
