"""Switches, loads at the limits of their law, loads that are too much, and set-points beyond their bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.equipment.imported_equipment import bus_behind
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.switchboard import Switchboard
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent
from gridpeers.plant.tables import FeederError, read_feeder
from tests.unit.plant.feeder.test_feeder import opened, plant, run

H = 0.002


def event(t: float, switch: str, action: str) -> SwitchEvent:
    return SwitchEvent(t=t, switch=switch, action="open" if action == "open" else "close")


def test_a_step_operates_its_switches_together(network: Network) -> None:
    """All switches of one step operate at once, by any name, and each event has the alias."""
    board = Switchboard(network, (event(0.5, "sw1_2", "open"), event(0.5, "152-13", "open")), H)

    told = board.operate(250)

    assert not board.steps
    assert board.closed == network.closed0 - {"67s-67", "13-152"}
    assert [(note.t, note.kind, note.subject, note.text) for note in told] == [
        (0.5, "switch", "67s-67", "switch sw1_2 (67s-67) opened"),
        (0.5, "switch", "13-152", "switch 13-152 opened"),
    ]


def test_a_switch_of_an_imported_line_is_named_after_the_line(network: Network) -> None:
    """The bus that an import puts behind a switch is in no drawing of the user's, so events do not name it."""
    (first, *others) = network.feeder.switches
    behind = bus_behind(first.from_bus, "head")
    imported = replace(first, name=f"{first.from_bus}-{behind}", alias="head", to_bus=behind)
    bus = next(bus for bus in network.feeder.buses if bus.name == first.from_bus)
    buses = (*network.feeder.buses, replace(bus, name=behind))
    board = Switchboard(Network(replace(network.feeder, buses=buses, switches=(imported, *others))), (), H)

    board.put(0, "head", "open")
    (told,) = board.operate(0)

    assert (told.subject, told.text) == ("head", "switch head opened")
    assert imported.name not in board.closed


def test_an_unknown_switch_is_refused_when_it_is_put_down(network: Network) -> None:
    """A misspelled switch is an error at the start of a run, not at its time."""
    with pytest.raises(ValueError, match=r'switch "13-125": no such switch'):
        Switchboard(network, (event(1.0, "13-125", "open"),), H)


pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

SCRIPT = """Clear
New Circuit.test bus1=s basekv=12.47 pu=1.02
New Line.head bus1=s bus2=b r1=0.1 x1=0.3 r0=0.3 x0=0.9 length=1 c1=0 c0=0
New Transformer.t phases=3 windings=2 xhl=4 %loadloss=1 kvs=(12.47 0.48) kvas=(500 500) buses=(BUSES) conns=(CONNS)
New Line.low bus1=c bus2=d r1=0.01 x1=0.03 r0=0.03 x0=0.09 length=1 c1=0 c0=0
New Load.a bus1=d phases=3 conn=delta kv=0.48 kw=100 kvar=20
New Load.x bus1=d.1.2 phases=1 conn=delta kv=0.48 kw=40
UNIT
Set VoltageBases=(12.47 0.48)
CalcVoltageBases
Solve
"""

DELTA, FLOATING, GROUNDED = ("b c", "delta delta"), ("b.1.2.3.4 c", "wye delta"), ("b c", "delta wye")

GENERATOR = "New Generator.g bus1=d phases=3 kv=0.48 kw=20 model=1"
PV = "New PVSystem.pv bus1=d phases=3 kv=0.48 kva=60 pmpp=50 irradiance=1"
HARDLY_GROUNDED = f"{GENERATOR}\nNew Load.r bus1=d phases=3 kv=0.48 kw=3 model=2"


def scaled(folder: Path, connection: tuple[str, str], unit: str, factor: float) -> Tables:
    """Import a feeder with a unit behind a transformer, its loads times a factor, and one inverter before it."""
    buses, windings = connection
    script = folder / "unit.dss"
    script.write_text(SCRIPT.replace("BUSES", buses).replace("CONNS", windings).replace("UNIT", unit))
    feeder = read_opendss(script)
    parts = tuple(
        replace(part, S=part.S * (factor if part.name.startswith("load") else 1.0)) for part in feeder.load_parts
    )
    row = InverterRow(name="i", kind="GFM", bus="b", microgrid="1", P_rated=1e6, V_nom=7200.0, m_p=0.01, m_q=0.05)
    return replace(feeder, load_parts=parts, inverters=(row,))


@pytest.mark.parametrize(("connection", "unit", "name", "factor"), [
    (DELTA, GENERATOR, "generator.g", 1.0),
    (DELTA, PV, "pvsystem.pv", 0.05),
    (FLOATING, GENERATOR, "generator.g", 0.05),  # beside all of the load there is a point, though OpenDSS has none
    (DELTA, HARDLY_GROUNDED, "generator.g", 0.05),
])  # fmt: skip
def test_constant_power_that_nothing_grounds_is_named(
    tmp_path: Path, connection: tuple[str, str], unit: str, name: str, factor: float
) -> None:
    """At any load factor the unit is the cause, with its bus; the load as a whole is not blamed, at the import too."""
    with pytest.raises((FeederError, PlantError)) as refused:
        Plant(Network(scaled(tmp_path, connection, unit, factor)), PlantSettings(), 0.02, 0.02)

    assert f"cannot feed the constant power of {name} at bus d (" in str(refused.value)
    assert "the load may be more" not in str(refused.value)


def test_the_same_unit_behind_a_grounded_winding_starts(tmp_path: Path) -> None:
    """Its voltage to ground is that of the winding."""
    Plant(Network(scaled(tmp_path, GROUNDED, GENERATOR, 1.0)), PlantSettings(), 0.02, 0.02)


def islanded() -> Plant:
    """Give the microgrid feeder, islanded for a second."""
    p = plant(*opened(0.1, "13-152"))
    run(p, 1.0)
    p.take_events()
    return p


def frequencies(p: Plant) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Give the recorded frequencies (Hz), a row per control period."""
    return np.array(p.take_rows())[:, 1::6]


@pytest.mark.parametrize("P_set", [1e7, -1e300])
def test_absurd_set_points_of_a_gfm_are_bounded_and_the_run_continues(P_set: float) -> None:
    """P_set is bounded at 3 pu, and with it the frequency, whatever the set-point."""
    p = islanded()
    p.take_rows()

    for _ in range(100):
        p.hold("inv1", P_set, 2401.8)
        p.advance()

    assert p.measure()["inv1"].P_set == pytest.approx(np.sign(P_set) * 3.0 * 600e3)
    assert np.all(np.abs(frequencies(p) - 60.0) < 2.0)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_set_points_that_are_not_finite_are_ignored(value: float) -> None:
    """NaN and infinity are ignored, alone or beside a valid value."""
    p = islanded()
    before = p.measure()["inv1"]

    p.hold("inv1", value, 2401.8)
    p.hold("inv1", 300e3, value)

    after = p.measure()["inv1"]
    assert (after.P_set, after.V_set) == (before.P_set, before.V_set)
    assert [event.subject for event in p.take_events()] == ["inv1"]


def test_a_spell_of_limited_set_points_is_one_event_with_value_and_bound() -> None:
    """A hundred set-points beyond the bound make one event with value and bound; a later spell makes another."""
    p = islanded()

    for _ in range(100):
        p.hold("inv1", 1e7, 2401.8)
        p.advance()
    begun = p.take_events()
    for P_set in (*[3e5] * 60, 1e7):
        p.hold("inv1", P_set, 2401.8)
        p.advance()

    begun = tuple(event for event in begun if "P_set" in event.text)  # beside that of its phase currents
    assert [(event.kind, event.subject) for event in begun] == [("limit", "inv1")]
    assert "10000 kW" in begun[0].text
    assert "1800 kW" in begun[0].text
    assert ["P_set 10000 kW" in event.text for event in p.take_events()] == [True]


@pytest.mark.parametrize(("settings", "said"), [
    (PlantSettings(P_set0=1.1, gfl=Gfl(P_max=1.1)), r"inv1 needs P of \d+ kW; .*P_set0_pu"),
    (PlantSettings(V_set0=1.2), r"inv1 needs an internal voltage of 1\.\d+ pu; .*E_max_pu.*V_set0_pu"),
    (PlantSettings(gfm=GfmDroop(Q_max=0.01)), r"inv1 needs Q of \d+(\.\d+)? kvar; .*Q_max_pu.*V_set0_pu"),
])  # fmt: skip
def test_a_start_beyond_the_limits_of_the_gfm_that_holds_an_island_up_is_refused(
    settings: PlantSettings, said: str
) -> None:
    """A start at which a limiter already acts is no equilibrium: f or vars would move at once, without an event."""
    with pytest.raises(PlantError, match=f"no equilibrium at t = 0: {said}"):
        Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.02)
