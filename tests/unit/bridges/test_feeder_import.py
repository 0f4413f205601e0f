"""An import is held against the other program, and its buses have names that tables can hold."""

from pathlib import Path

import pytest

from gridpeers.bridges.feeder_import import FeederImport, difference
from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.network import Network, solve_power_flow
from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN, write


def test_each_bus_keeps_a_name_of_its_own() -> None:
    """Blanks, tildes and characters that cannot be printed become "_", and a number tells equal names apart."""
    found = FeederImport("x.dss")
    found.places = {"bus a b": "x.dss:3", "line.l 1": "x.dss:4"}

    names = found.name_buses(["a b", "a_b", "a\u00a0b", "x~y", "plain.1 (c)", "rg-60.x:(1)"])

    assert list(map(names.get, ("a b", "a_b", "a\u00a0b"))) == ["a_b_2", "a_b", "a_b_3"]
    assert list(map(names.get, ("x~y", "plain.1 (c)", "rg-60.x:(1)"))) == ["x_y", "plain.1_(c)", "rg-60.x:(1)"]
    assert found.places == {"bus a_b_2": "x.dss:3", "line.l 1": "x.dss:4"}
    assert found.notes == [
        'buses have other names here, without blanks: "a b" is a_b_2, "a\u00a0b" is a_b_3, "x~y" is x_y, '
        '"plain.1 (c)" is plain.1_(c)',
    ]


def test_a_bus_behind_a_switch_follows_its_bus() -> None:
    """The bus behind a switch has a plain name after that of its bus, whose place its problems have."""
    found = FeederImport("x.dss")
    found.places = {"bus a_b": "x.dss:3"}

    behind = found.add_switch("a_b", "sw 1", "ABC", closed=True)
    found.refuse(f"bus {behind}", "nothing determines its voltage to ground")

    (switch,) = found.switches
    assert (switch.name, switch.alias, behind) == ("a_b-a_b~sw_1", "sw 1", "a_b~sw_1")
    assert found.problems == ["x.dss:3: bus a_b~sw_1: nothing determines its voltage to ground"]


def test_a_blank_in_a_name_reaches_no_table(tmp_path: Path) -> None:
    """A script with a blank in a bus's name is read, with the source, a switch and a load there."""
    pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")
    script = (
        'New Line.z bus1=b bus2="b x" r1=.1 x1=.1 r0=.1 x0=.1\n'
        'New Line.y bus1="b x" bus2=d switch=yes\nNew Load.m bus1="b x" kv=12.47 kw=9'
    )

    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, script))

    assert {"b_x", "b_x~y"} <= {bus.name for bus in feeder.buses}
    assert [switch.name for switch in feeder.switches] == ["b_x-b_x~y"]
    assert {part.bus for part in feeder.load_parts} == {"b_x"}


def test_a_difference_is_found_where_it_is(tmp_path: Path) -> None:
    """A voltage that is off by a thousandth is found at its node; equal ones do not differ."""
    pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, "New Load.l bus1=c phases=3 kv=0.48 kw=90 kvar=20"))
    network = Network(feeder)
    theirs = dict(zip(network.nodes, solve_power_flow(network, network.closed0).tolist(), strict=True))

    assert difference(feeder, theirs)[0] < 1e-9
    worst, node = difference(feeder, theirs | {("c", "B"): theirs["c", "B"] * 1.001})
    assert node == ("c", "B")
    assert worst == pytest.approx(1e-3, rel=0.05)
