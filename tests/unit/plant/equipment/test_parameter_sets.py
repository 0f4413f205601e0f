"""Parameters of single inverters: published sets, keys of the scenario, and which of them wins."""

from pathlib import Path

import pytest
from msgspec.structs import replace

import gridpeers as gp
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.regfm_a1 import REGFM_A1
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import ScenarioError, load_scenario


def scenario_of(tmp_path: Path, tables: str = "", feeder: str = "microgrid123") -> Path:
    """Islanding with further tables."""
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


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ("[plant.inverter.inv1]\nS_max_pu = 1", r"plant.inverter.inv1.S_max_pu: a GFM has no such parameter"),
        ('[plant.inverter.inv2]\nmodel = "regfm_a1"', r'inv2.model: a GFL has no model "regfm_a1"'),
        ('[plant.inverter.inv1]\nparameters = "regfm_a"', r'no parameter set "regfm_a"; did you mean "regfm_a1"\?'),
        ('[plant.inverter.inv2]\nparameters = "regfm_a1"', r'set "regfm_a1" has .*, which a GFL has not'),
        ("[plant.inverter.inv1]\nT_p = 0.1", r'plant.inverter.inv1.T_p: unknown key; did you mean "T_p_s"'),
        (
            "[plant.inverter.inv1]\nP_min_pu = 1.1",
            r"inv1.P_min_pu: 1.1 pu must be below P_max_pu = 1 pu; .*\[plant.gfm\]",
        ),
        ("[plant.inverter.inv1]\nP_max_pu = 0.5", r"0.647 pu is above P_max_pu of inv1 = 0.5 pu"),
        ("[plant.inverter.inv1]\nT_p_s = 0.005", r"too long a step for T_p_s = 0.005 s of \[plant.inverter.inv1\]"),
    ],
)
def test_parameters_that_an_inverter_cannot_have_are_told(tmp_path: Path, tables: str, said: str) -> None:
    """Each problem names its key and inverter, before anything starts."""
    path = scenario_of(tmp_path, f"\n{tables}\n")

    with pytest.raises(ScenarioError, match=said):
        load_scenario(path)
