"""Parameters of single inverters: sets of the feeder, keys of the scenario, and which of them wins."""

import csv
import shutil
from pathlib import Path

import pytest
from msgspec.structs import replace

import gridpeers as gp
from gridpeers.plant.equipment import Bus, Source
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.regfm_a1 import REGFM_A1
from gridpeers.plant.tables import FeederError, read_feeder
from gridpeers.plant.tables.read import DATA
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import ScenarioError, load_scenario

SETS = "set,key,value\nslow,T_pf_s,0.2\nslow,k_pPLL,40\nslow,volt_var,false\nstiff,P_max_pu,1.2\n"


def folder_of(tmp_path: Path, sets: str = SETS, **parameters: str) -> Path:
    """Microgrid123 with sets of parameters, and inverters that name one."""
    folder = Path(shutil.copytree(DATA / "microgrid123", tmp_path / "mine"))
    (folder / "inverter_parameters.csv").write_text(sets, encoding="utf-8")
    with (folder / "inverters.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    with (folder / "inverters.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, [*rows[0], "parameters"])
        writer.writeheader()
        writer.writerows(row | {"parameters": parameters.get(row["name"], "")} for row in rows)
    return folder


def scenario_of(tmp_path: Path, folder: Path, tables: str = "") -> Path:
    """Islanding on that feeder, with further tables."""
    text = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace('feeder = "microgrid123"', f'feeder = "{folder}"') + tables, encoding="utf-8")
    return path


def test_an_inverters_own_keys_come_before_its_set_and_its_set_before_its_kind(tmp_path: Path) -> None:
    """[plant.inverter.NAME] beats the feeder's set, which beats [plant.gfl], which beats the defaults."""
    folder = folder_of(tmp_path, inv2="slow", inv3="slow")
    tables = "\n[plant.inverter.inv2]\nk_pPLL = 30\n[plant.gfl]\nT_pf_s = 0.1\nT_qf_s = 0.15\n"
    scenario, feeder = load_scenario(scenario_of(tmp_path, folder, tables))

    units = [feeder.parameters_of(row, scenario.plant.gfm, scenario.plant.gfl) for row in feeder.inverters]
    gfl = [unit for unit in units if isinstance(unit, Gfl)][:3]

    assert [it.k_pPLL for it in gfl] == [30.0, 40.0, 50.0]
    assert [it.T_pf for it in gfl] == [0.2, 0.2, 0.1]
    assert [it.T_qf for it in gfl] == [0.15, 0.15, 0.15]
    assert [it.volt_var for it in gfl] == [False, False, True]


def test_the_published_values_of_a_model_are_a_set_of_every_feeder(tmp_path: Path) -> None:
    """`parameters = "regfm_a1"` gives them all, whatever [plant.gfm] has; bounds of set-points are not among them."""
    tables = (
        "\n[plant.gfm]\nP_max_pu = 1.5\nV_set_max_pu = 1.1\n"
        '[plant.inverter.inv1]\nparameters = "regfm_a1"\n'
        '[plant.inverter.inv4]\nparameters = "regfm_a1_vflag0"\nP_max_pu = 1.0\n'
    )
    scenario, feeder = load_scenario(scenario_of(tmp_path, folder_of(tmp_path), tables))

    units = [feeder.parameters_of(row, scenario.plant.gfm, scenario.plant.gfl) for row in feeder.inverters]

    assert units[0] == replace(REGFM_A1, V_set_max=1.1)
    assert units[3] == replace(REGFM_A1, V_set_max=1.1, voltage_control=False, k_pq=0.1, k_iq=10.0, P_max=1.0)
    assert units[6] == GfmDroop(P_max=1.5, V_set_max=1.1)


def test_all_mistakes_of_a_set_come_at_once(tmp_path: Path) -> None:
    """Unknown keys, wrong values, repeats, contradictions, sets that there are not and keys of the other kind."""
    rows = "a,T_pff_s,1\na,T_pf_s,20\na,T_vf_s,x\nb,P_max_pu,0.1\nb,P_min_pu,0.5\nb,P_max_pu,1\nc,S_max_pu,1\n"
    folder = folder_of(tmp_path, f"set,key,value\n{rows}", inv1="c", inv2="d")

    with pytest.raises(FeederError) as caught:
        read_feeder(str(folder))

    said = "\n".join(caught.value.problems)
    for part in (
        'row 2: set "a": T_pff_s: unknown key; did you mean "T_pf_s"?',
        'row 3: set "a": T_pf_s: 20 s is not plausible for a time constant (1e-05 to 10 s); did you mean 0.02 (20 ms)?',
        'row 4: set "a": T_vf_s: must be a number, got "x"',
        'row 7: set "b" has P_max_pu already; give each parameter once',
        'set "b": P_min_pu: 0.5 pu must be below P_max_pu = 0.1 pu; swap them or set both',
        'inverters.csv row 2: parameters "c": a GFM has no S_max_pu; give it a set of its own',
        'inverters.csv row 3: parameters "d": no such set; the sets are a, b, c, regfm_a1, regfm_a1_vflag0',
    ):
        assert part in said


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ("[plant.inverter.inv1]\nS_max_pu = 1", r"plant.inverter.inv1.S_max_pu: a GFM has no such parameter"),
        ('[plant.inverter.inv2]\nmodel = "regfm_a1"', r'inv2.model: a GFL has no model "regfm_a1"'),
        ('[plant.inverter.inv2]\nparameters = "slwo"', r'no parameter set "slwo"; did you mean "slow"\?'),
        ('[plant.inverter.inv1]\nparameters = "slow"', r'set "slow" has k_pPLL, which a GFM has not'),
        ("[plant.inverter.inv1]\nT_p = 0.1", r"plant.inverter.inv1.T_p: unknown key; write T_p_s, in seconds"),
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
    path = scenario_of(tmp_path, folder_of(tmp_path), f"\n{tables}\n")

    with pytest.raises(ScenarioError, match=said):
        load_scenario(path)


def test_parameters_of_an_added_inverter_are_saved_and_read_again(tmp_path: Path) -> None:
    """`add_inverter(params=)` takes some keys, all parameters, or the name of a set; equal ones are one set."""
    buses = tuple(Bus(name=name, phases="ABC", V_nom=2400.0) for name in ("1", "2", "3"))
    whole = gp.Feeder(
        name="mine", load_set="main", buses=buses, lines=(), line_configs=(), switches=(), loads=(), capacitors=(),
        regulators=(), transformers=(), inverters=(), source=Source(bus="1", V_pu=1.0, angle=0.0),
    )  # fmt: skip
    some = {"T_pf_s": 0.2, "volt_var": False}
    feeder = whole.add_inverter("a", "1", "GFL", 1e5, params=some).add_inverter("b", "2", "GFL", 1e5, params=some)
    feeder = feeder.add_inverter("c", "3", "GFM", 1e5, params=GfmDroop(P_max=1.2))

    folder = feeder.save(tmp_path / "saved")
    sets = feeder.parameter_sets

    assert [row.parameters for row in feeder.inverters] == ["a", "a", "c"]
    assert sets["a"] == {"T_pf": 0.2, "volt_var": False}
    assert sets["c"]["k_ip"] == GfmDroop().k_ip
    with pytest.raises(FeederError, match="nothing connects it"):  # its tables are right apart from that
        read_feeder(str(folder))
    assert "a,volt_var,false\n" in (folder / "inverter_parameters.csv").read_text()


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"T_pf": 0.2}, "inv11.*T_pf: unknown key; write T_pf_s"),
        ({"T_p_s": 0.2}, "T_p_s: a GFL has no such parameter"),
        (GfmDroop(), "a GFL has no such parameter"),
        ("slow", 'no parameter set "slow"'),
        (7, "params: must be the name of a set, .* got 7"),
    ],
)
def test_wrong_parameters_of_an_added_inverter_are_refused(params: object, said: str) -> None:
    """The error names the inverter and what would be right."""
    with pytest.raises(ValueError, match=said):
        gp.Feeder.read("microgrid123").add_inverter("inv11", "87", "GFL", 2e5, params=params)  # type: ignore[arg-type]
