"""An import is held against the other program, and its buses have names that tables can hold."""

from pathlib import Path

import pytest

from gridpeers.bridges.import_checks import difference, with_plain_names
from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.equipment import Bus, Feeder, Source, Switch
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart, bus_behind
from gridpeers.plant.network import Network, solve_power_flow
from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN, write


def feeder_of(*names: str, switched: str = "") -> tuple[Feeder, dict[str, str]]:
    """Return a feeder with these buses, the first its source, and the buses that its import has added."""
    behind = bus_behind(names[0], switched)
    added = {behind: names[0]} if switched else {}
    buses = tuple(Bus(name=name, phases="A", V_nom=7200.0) for name in (*names, *added))
    element = LinearElement(name="line.l 1", nodes=((behind if switched else names[0], "A"),), Y=((1j,),))
    part = LoadPart(name="load.a b", bus=names[-1], ends=("A", ""), S=1e3, V_nom=7200.0, exponents=(2.0, 2.0))
    switch = Switch(
        name=f"{names[0]}-{behind}", alias=switched, from_bus=names[0], to_bus=behind, phases="A", closed=True
    )
    feeder = Feeder(
        name="f",
        load_set="main",
        buses=buses,
        source=Source(bus=names[0], V_pu=1.0, angle=0.0),
        elements=(element,),
        load_parts=(part,),
        switches=(switch,) if switched else (),
        places={"bus a b": "x.dss:3", "line.l 1": "x.dss:4"},
    )
    return feeder, added


def test_each_bus_keeps_a_name_of_its_own() -> None:
    """Blanks, tildes and characters that cannot be printed become "_", and a number tells equal names apart."""
    feeder, added = feeder_of("a b", "a_b", "a\u00a0b", "x~y", "plain.1 (c)")

    found = with_plain_names(feeder, added)

    assert [bus.name for bus in found.buses] == ["a_b_2", "a_b", "a_b_3", "x_y", "plain.1_(c)"]
    assert found.source is not None
    assert found.source.bus == "a_b_2"
    assert found.load_parts[0].bus == "plain.1_(c)"
    assert found.places == {"bus a_b_2": "x.dss:3", "line.l 1": "x.dss:4"}
    assert found.notes == (
        'buses have other names here, without blanks: "a b" is a_b_2, "a\u00a0b" is a_b_3, "x~y" is x_y, '
        '"plain.1 (c)" is plain.1_(c)',
    )


def test_a_bus_behind_a_switch_follows_its_bus() -> None:
    """A bus that the import has added is still behind the bus before it; the switch keeps its own name."""
    found = with_plain_names(*feeder_of("a b", "c", switched="sw 1"))

    (switch,) = found.switches
    assert (switch.name, switch.alias) == ("a_b-a_b~sw_1", "sw 1")
    assert found.elements[0].name == "line.l 1"
    assert found.elements[0].nodes == (("a_b~sw_1", "A"),)
    assert found.load_parts[0].name == "load.a b"


def test_plain_names_stay() -> None:
    """A feeder whose names its tables can hold stays as it is."""
    feeder, added = feeder_of("650", "rg-60.x:(1)", switched="632-671")
    element = LinearElement(name="line.l1", nodes=feeder.elements[0].nodes, Y=((1j,),))
    feeder = Feeder(**{name: getattr(feeder, name) for name in feeder.__struct_fields__} | {"elements": (element,)})

    assert with_plain_names(feeder, added) is feeder


def test_a_difference_is_found_where_it_is(tmp_path: Path) -> None:
    """A voltage that is off by a thousandth is found at its node; equal ones do not differ."""
    pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, "New Load.l bus1=c phases=3 kv=0.48 kw=90 kvar=20"))
    network = Network(feeder)
    theirs = dict(zip(network.nodes, solve_power_flow(network, network.closed0).V.tolist(), strict=True))

    assert difference(feeder, theirs)[0] < 1e-9
    worst, node = difference(feeder, theirs | {("c", "B"): theirs["c", "B"] * 1.001})
    assert node == ("c", "B")
    assert worst == pytest.approx(1e-3, rel=0.05)
