"""The equipment of a feeder: what is connected, loads by name, parameters of single inverters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import gridpeers as gp
from gridpeers.plant.equipment import Load
from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.equipment.named_loads import load_name, named_loads, with_powers
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.regfm_a1 import REGFM_A1
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import ScenarioError, load_scenario
from tests.unit.plant.networks import feeder, three_phase_bus


@pytest.mark.parametrize("turned", [False, True])
def test_a_switch_cuts_off_the_side_without_the_substation(turned: bool) -> None:
    """Opening 13-152 cuts off the microgrids, whichever of its buses is named first."""
    feeder = read_feeder("microgrid123")
    switch = next(switch for switch in feeder.switches if switch.name == "13-152")
    others = tuple(each for each in feeder.switches if each is not switch)
    if turned:
        switch = replace(switch, from_bus=switch.to_bus, to_bus=switch.from_bus)
    buses = Connectivity(replace(feeder, switches=(switch, *others))).cut_off(switch)

    assert {"152", "160", "300"} <= buses
    assert not {"150", "13", "1"} & buses


def test_a_single_phase_inverter_feeds_its_own_phase_alone() -> None:
    """Without the substation a GFM on phase C feeds the nodes of phase C; one of three phases feeds all."""
    feeder = replace(read_feeder("microgrid123"), source=None)
    graph = Connectivity(feeder)
    single = replace(feeder.inverters[0], phases="C")

    closed = graph.closed_at_start() - {"61-61s"}  # behind it a delta transformer joins the phases
    fed, dead = graph.fed(closed, [single])
    whole, _ = graph.fed(closed, feeder.inverters[:1])

    assert {phase for part in fed for _, phase in part} == {"C"}
    assert ("160", "A") in frozenset().union(*dead)
    assert {phase for part in whole for _, phase in part} == {"A", "B", "C"}


def test_the_tables_are_the_import_of_the_published_feeder_with_our_modifications() -> None:
    """The tables are the engine's present reading of the script, to rounding."""
    pytest.importorskip("dss", reason="the OpenDSS engine is not installed")
    from tests.feeders.ieee34_microgrids import ieee34_microgrids

    made, kept = ieee34_microgrids(), read_feeder("ieee34")

    assert [element.nodes for element in made.elements] == [element.nodes for element in kept.elements]
    for one, other in zip(made.elements, kept.elements, strict=True):
        np.testing.assert_allclose(other.Y, one.Y, rtol=1e-9, atol=1e-12, err_msg=one.name)
    assert kept.switches == made.switches
    assert [replace(row, V_nom=0.0) for row in kept.inverters] == [replace(row, V_nom=0.0) for row in made.inverters]
    assert [(part.name, part.bus, part.ends, part.exponents) for part in kept.load_parts] == [
        (part.name, part.bus, part.ends, part.exponents) for part in made.load_parts
    ]
    assert sum(part.S for part in kept.load_parts) == pytest.approx(1769e3 + 1044e3j)
    assert {bus.zone for bus in kept.buses} == {"rest", "MG1", "MG2", "MG3"}


def part(name: str, bus: str, S: complex) -> LoadPart:
    """A part of an imported load, of constant power."""
    return LoadPart(name=name, bus=bus, ends=("A", ""), S=S, V_nom=2400.0, exponents=(0.0, 0.0))


def load(bus: str, *S: complex, model: str = "P") -> Load:
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
    assert (pytest.approx(0.125e3j), pytest.approx(0.375e3j), 0) == with_powers(resistive, {"2": 0.5e3j}).loads[0].S


def scenario_of(tmp_path: Path, tables: str = "", feeder: str = "microgrid123") -> Path:
    text = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace('feeder = "microgrid123"', f'feeder = "{feeder}"') + tables, encoding="utf-8")
    return path


def test_an_inverters_own_keys_come_before_its_set_and_its_set_before_its_kind(tmp_path: Path) -> None:
    """[plant.inverter.NAME] beats a published set, which beats [plant.gfm], which beats the defaults.

    A set gives all values of its model but bounds of set-points; a scenario may name another one than the feeder.
    """
    feeder = gp.Feeder.read("microgrid123", "event2")
    feeder = feeder.add_inverter("a", "87", "GFM", 1e5, params="regfm_a1").add_inverter("b", "78", "GFL", 1e5)
    tables = (
        "\n[plant.gfm]\nP_max_pu = 1.5\nV_set_max_pu = 1.1\n[plant.gfl]\nT_pf_s = 0.1\nT_qf_s = 0.15\n"
        '[plant.inverter.inv4]\nparameters = "regfm_a1_vflag0"\nP_max_pu = 1.0\n[plant.inverter.inv2]\nT_pf_s = 0.2\n'
    )
    scenario, feeder = load_scenario(scenario_of(tmp_path, tables, str(feeder.save(tmp_path / "mine"))))

    rows = {row.name: row for row in feeder.inverters}
    units = {name: feeder.parameters_of(row, scenario.plant.gfm, scenario.plant.gfl) for name, row in rows.items()}

    assert units["a"] == replace(REGFM_A1, V_set_max=1.1)
    assert units["inv4"] == replace(REGFM_A1, V_set_max=1.1, voltage_control=False, k_pq=0.1, k_iq=10.0, P_max=1.0)
    assert units["inv7"] == GfmDroop(P_max=1.5, V_set_max=1.1)
    assert units["inv2"] == Gfl(T_pf=0.2, T_qf=0.15)
    assert units["b"] == Gfl(T_pf=0.1, T_qf=0.15)


@pytest.mark.parametrize(("tables", "said"), [
    ("[plant.inverter.inv1]\nS_max_pu = 1", r"plant.inverter.inv1.S_max_pu: a GFM has no such parameter"),
    ('[plant.inverter.inv2]\nmodel = "regfm_a1"', r'inv2.model: a GFL has no model "regfm_a1"'),
    ('[plant.inverter.inv1]\nparameters = "regfm_a"', r'no parameter set "regfm_a"; did you mean "regfm_a1"\?'),
    ('[plant.inverter.inv2]\nparameters = "regfm_a1"', r'set "regfm_a1" has .*, which is no parameter of a GFL'),
    ("[plant.inverter.inv1]\nT_p = 0.1", r'plant.inverter.inv1.T_p: unknown key; did you mean "T_p_s"'),
    (
        "[plant.inverter.inv1]\nP_min_pu = 1.1",
        r"inv1.P_min_pu: 1.1 pu must be below P_max_pu = 1 pu; .*\[plant.gfm\]",
    ),
    ("[plant.inverter.inv1]\nP_max_pu = 0.5", r"0.647 pu is above P_max_pu of inv1 = 0.5 pu"),
    (
        "[plant.inverter.inv1]\nT_p_s = 0.005",
        r"too long a step to resolve T_p_s = 0.005 s of \[plant.inverter.inv1\]",
    ),
])  # fmt: skip
def test_parameters_that_an_inverter_cannot_have_are_problems(tmp_path: Path, tables: str, said: str) -> None:
    """Each problem names its key and inverter, before anything starts."""
    path = scenario_of(tmp_path, f"\n{tables}\n")

    with pytest.raises(ScenarioError, match=said):
        load_scenario(path)
