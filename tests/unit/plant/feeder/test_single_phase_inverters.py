"""Single-phase inverters on a feeder: laterals, legs of one bus, islands, trips and reclosing."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment import Bus, InverterRow, Line, LineConfig, Load, Source, Switch, Tables
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, PowerLimit, Protection, SwitchEvent
from tests.unit.plant.networks import feeder, three_phase_bus

V_NOM = 2400.0
T_C = 0.02
Z_SELF, Z_MUTUAL = 0.3 + 0.6j, 0.1 + 0.3j


def unit(name: str, kind: str, bus: str, phases: str, P_rated: float) -> InverterRow:
    return InverterRow(
        name=name,
        kind=kind,  # type: ignore[arg-type]
        bus=bus,
        phases=phases,  # type: ignore[arg-type]
        microgrid="MG1",
        P_rated=P_rated,
        V_nom=V_NOM,
        m_p=0.01,
        m_q=0.05,
    )


def small(*inverters: InverterRow, lateral_load: float = 40e3) -> Tables:
    """A substation 0, a switch, a line to bus 2, a line to bus 3, and from there behind a switch a lateral of phase B.

    ::

        0 --/-- 1 ----- 2 ----- 3 --/-- 4 ----- 5 ----- 6
                        ABC                 B
    """
    Z = tuple(tuple(Z_SELF if i == k else Z_MUTUAL for k in range(3)) for i in range(3))
    none = ((0.0,) * 3,) * 3
    lines = [
        Line(name=f"{a}{b}", from_bus=a, to_bus=b, phases="ABC", config="abc", length=0.5) for a, b in ("12", "23")
    ]
    lines += [Line(name=f"{a}{b}", from_bus=a, to_bus=b, phases="B", config="b", length=0.2) for a, b in ("45", "56")]
    return feeder(
        buses=(*(three_phase_bus(name) for name in "0123"), *(Bus(name=n, phases="B", V_nom=V_NOM) for n in "456")),
        lines=tuple(lines),
        line_configs=(
            LineConfig(name="abc", phases="ABC", Z=Z, B=none),
            LineConfig(name="b", phases="B", Z=((Z_SELF,),), B=((0.0,),)),
        ),
        switches=(
            Switch(name="0-1", alias="grid", from_bus="0", to_bus="1", phases="ABC", closed=True),
            Switch(name="3-4", alias="lateral", from_bus="3", to_bus="4", phases="B", closed=True),
        ),
        loads=(
            Load(bus="3", connection="Y", model="P", S=(60e3 + 2e4j, 40e3 + 1e4j, 50e3 + 1e4j)),
            Load(bus="6", connection="Y", model="P", S=(0j, lateral_load + 0.2j * lateral_load, 0j)),
        ),
        source=Source(bus="0", V_pu=1.0, angle=0.0),
        inverters=inverters,
    )


ON_LATERAL = (
    unit("inv1", "GFM", "2", "ABC", 300e3),
    unit("leg", "GFM", "5", "B", 60e3),
    unit("roof", "GFL", "6", "B", 30e3),
)


def plant(of: Tables, *events: SwitchEvent, **settings: object) -> Plant:
    """The plant of a feeder, started at half of the ratings, with these switchings."""
    chosen = {"P_set0": 0.5, "events": events} | settings
    return Plant(Network(of), PlantSettings(**chosen), T_C, T_C)  # type: ignore[arg-type]


def run(p: Plant, until: float) -> list[str]:
    """Advance to a time; the texts of the events."""
    while p.tick * T_C < until - 1e-9:
        p.advance()
    return [event.text for event in p.take_events()]


def test_a_lateral_is_an_island_of_its_own_grid_forming_inverter() -> None:
    """Behind its open switch phase B has the frequency of the droop of its own GFM, the rest that of the other."""
    p = plant(
        small(*ON_LATERAL),
        SwitchEvent(t=0.1, switch="grid", action="open"),
        SwitchEvent(t=0.2, switch="lateral", action="open"),
    )
    told = run(p, 8.0)
    now = p.measure()

    assert told[-2:] == ["island of inv1", "island of leg, roof"]
    assert [now[name].island for name in ("inv1", "leg", "roof")] == ["inv1", "leg", "leg"]
    for name, rating in (("inv1", 300e3), ("leg", 60e3), ("roof", 30e3)):
        assert now[name].f - 60.0 == pytest.approx(0.6 * (0.5 - now[name].P / rating), abs=1e-4), name
    assert pytest.approx(40e3, rel=0.01) == now["leg"].P + now["roof"].P


def test_an_overloaded_lateral_trips_and_restarts_by_itself() -> None:
    """Underfrequency trips both inverters of the phase; after the delay they start it together."""
    p = plant(
        small(*ON_LATERAL, lateral_load=75e3),
        SwitchEvent(t=0.1, switch="grid", action="open"),
        SwitchEvent(t=0.1, switch="lateral", action="open"),
        limits=(PowerLimit(t=0.3, inverter="roof", P_max=1e3),),
        protection=Protection(enter_service=1.0),
    )
    told = run(p, 4.0)
    now = p.measure()

    assert any(text.startswith("leg tripped: underfrequency") for text in told)
    assert "black start by leg, roof" in told
    assert pytest.approx(75e3, rel=0.01) == now["leg"].P + now["roof"].P
    assert pytest.approx(1e3, rel=0.2) == now["roof"].P
    assert now["inv1"].f == pytest.approx(60.0, abs=1e-3)


def test_alone_on_three_phases_it_feeds_its_own() -> None:
    """A leg of phase B left with a three-phase section feeds phase B; constant power on the others has no solution."""
    islanding = SwitchEvent(t=0.1, switch="grid", action="open")
    table = small(unit("leg", "GFM", "5", "B", 300e3))
    impedances = replace(table, loads=tuple(replace(load, model="Z") for load in table.loads))
    feeding, collapsed = plant(impedances, islanding), plant(table, islanding)
    run(feeding, 2.0)

    assert any("leg tripped, as the island has no solution" in text for text in run(collapsed, 0.2))
    assert pytest.approx(80e3, rel=0.02) == feeding.measure()["leg"].P
    assert feeding.measure()["leg"].f - 60.0 == pytest.approx(
        0.6 * (0.5 - feeding.measure()["leg"].P / 300e3), abs=1e-4
    )


def test_a_side_that_is_live_on_one_phase_needs_the_check_too() -> None:
    """Where the phases are not coupled, a three-phase switch with phase B alone beyond is not closed blindly."""
    table = small(ON_LATERAL[0], unit("leg", "GFM", "3", "B", 60e3), lateral_load=5e3)
    configs = tuple(
        replace(each, Z=tuple(tuple(z * (i == k) for k, z in enumerate(row)) for i, row in enumerate(each.Z)))
        for each in table.line_configs
    )
    middle = Switch(name="2-9", alias="middle", from_bus="2", to_bus="9", phases="ABC", closed=True)
    lines = tuple(replace(line, from_bus="9") if line.name == "23" else line for line in table.lines)
    table = replace(
        table,
        line_configs=configs,
        lines=lines,
        buses=(*table.buses, three_phase_bus("9")),
        switches=(*table.switches, middle),
    )
    p = plant(
        table,
        SwitchEvent(t=0.1, switch="grid", action="open"),
        SwitchEvent(t=0.2, switch="middle", action="open"),
        SwitchEvent(t=3.0, switch="middle", action="close"),
    )
    told = run(p, 3.1)

    assert any(text.startswith("switch middle (2-9) joins two live islands: its sides are ") for text in told)
