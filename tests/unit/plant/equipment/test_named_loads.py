"""Loads by name, and other powers of them."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment import Load
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.equipment.named_loads import load_name, named_loads, with_powers
from tests.unit.plant.networks import feeder, three_phase_bus


def part(name: str, bus: str, S: complex) -> LoadPart:
    """A part of an imported load, of constant power."""
    return LoadPart(name=name, bus=bus, ends=("A", ""), S=S, V_nom=2400.0, exponents=(0.0, 0.0))


def load(bus: str, *S: complex, model: str = "P") -> Load:
    """A wye load of our own tables."""
    return Load(bus=bus, connection="Y", model=model, S=(S[0], S[1], S[2]))  # type: ignore[arg-type]


BUSES = (three_phase_bus("1"), three_phase_bus("2"))


def test_rows_of_one_bus_and_parts_of_one_load_are_one_load() -> None:
    """A bus stands for its load, unless an imported feeder has several there."""
    tables = feeder(
        buses=BUSES,
        loads=(load("1", 1e3, 2e3, 0), load("1", 0, 0, 4e3 + 1e3j, model="Z")),
        load_parts=(part("mill", "2", 5e3), part("mill", "2", 6e3), part("house", "2", 1e3)),
    )
    loads = named_loads(tables)

    assert {name: (one.bus, one.S) for name, one in loads.items()} == {
        "1": ("1", 7e3 + 1e3j),
        "mill": ("2", 11e3),
        "house": ("2", 1e3),
    }
    assert load_name(loads, "mill") == "mill"
    with pytest.raises(ValueError, match='load "2": bus 2 has 2 loads: mill, house; name one of them'):
        load_name(loads, "2")
    with pytest.raises(ValueError, match='load "hous": no such load; did you mean "house"'):
        load_name(loads, "hous")
    alone = named_loads(replace(tables, load_parts=tables.load_parts[:2]))
    assert load_name(alone, "2") == "mill"


def test_a_load_is_named_with_or_without_the_class_that_opendss_puts_before_it() -> None:
    """In an imported feeder as in our own tables; a name that is another load's bus too is refused with both."""
    loads = named_loads(feeder(buses=BUSES, loads=(load("1", 1e3, 0, 0),), load_parts=(part("load.mill", "2", 5e3),)))
    texts = ("mill", "load.mill", "Load.mill", "2", "1", "load.1")

    assert [load_name(loads, text) for text in texts] == ["load.mill"] * 4 + ["1"] * 2
    crossed = named_loads(feeder(buses=BUSES, load_parts=(part("load.1", "2", 5e3), part("load.house", "1", 1e3))))
    assert load_name(crossed, "load.1") == "load.1"
    with pytest.raises(ValueError, match=r'load "1": it has this name, or this bus: load\.1, load\.house; name one'):
        load_name(crossed, "1")


def test_branches_keep_their_shares() -> None:
    """Real and reactive power are scaled each; what had none goes by size; all other loads stay the same objects."""
    tables = feeder(buses=BUSES, loads=(load("1", 3e3 + 2e3j, 1e3, 0), load("1", 0, 0, 4e3), load("2", 1e3, 0, 0)))

    first, second, other = with_powers(tables, {"1": 4e3 + 1e3j}).loads

    assert (pytest.approx(1.5e3 + 1e3j), pytest.approx(0.5e3), 0) == first.S
    assert (0, 0, pytest.approx(2e3)) == second.S
    assert other is tables.loads[2]

    resistive = feeder(buses=BUSES, loads=(load("2", 1e3, 3e3, 0),))
    assert (
        pytest.approx(0.125e3j),
        pytest.approx(0.375e3j),
        0,
    ) == with_powers(resistive, {"2": 0.5e3j}).loads[0].S


def test_branches_that_cancel_are_not_blown_up() -> None:
    """A generator and a load of one name whose sum is nearly nothing: the difference is shared by size."""
    tables = feeder(buses=BUSES, load_parts=(part("both", "1", 3e3), part("both", "1", -3e3)))

    assert [one.S for one in with_powers(tables, {"both": 1e3 + 0j}).load_parts] == [3.5e3, -2.5e3]
