"""An import is held against the other program, and its buses have names that tables can hold."""

from gridpeers.bridges.feeder_import import FeederImport


def test_each_bus_keeps_a_name_of_its_own() -> None:
    """Blanks, tildes and characters that cannot be printed become "_", and a number tells equal names apart."""
    found = FeederImport("x.dss")
    found.places = {"bus a b": "x.dss:3", "line.l 1": "x.dss:4"}

    names = found.name_buses(["a b", "a_b", "a\u00a0b", "x~y", "plain.1 (c)", "rg-60.x:(1)"])

    assert list(map(names.get, ("a b", "a_b", "a\u00a0b"))) == ["a_b_2", "a_b", "a_b_3"]
    assert list(map(names.get, ("x~y", "plain.1 (c)", "rg-60.x:(1)"))) == ["x_y", "plain.1_(c)", "rg-60.x:(1)"]
    assert found.places == {"bus a_b_2": "x.dss:3", "line.l 1": "x.dss:4"}
    assert found.notes == [
        'buses are renamed, as a name has no blanks: "a b" is a_b_2, "a\u00a0b" is a_b_3, "x~y" is x_y, '
        '"plain.1 (c)" is plain.1_(c)'
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
