"""Regulators and capacitors of a .glm stand where GridLAB-D's own controls bring them to rest."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from gridpeers.bridges.gridlabd.read_glm import read_glm
from gridpeers.plant.network import Network, solve_power_flow
from tests.unit.bridges.gridlabd.glm_models import HEAD, TOLERANCE, write

pytest.importorskip("gridlabd", reason="the import of .glm files needs the extra gridlabd")

REGULATED = HEAD.replace("solver_method NR;", "solver_method NR; default_maximum_voltage_error 1e-9;") + (
    """object regulator_configuration { name rc; connect_type WYE_WYE; time_delay 30; dwell_time 10; raise_taps 16;
  lower_taps 16; regulation 0.1; Type A; tap_pos_A 1; tap_pos_B 1; tap_pos_C 1; REGULATOR }
object regulator { name reg; phases ABCN; from b; to r; configuration rc; SENSE }
object node { name r; phases ABCN; nominal_voltage 7200; }
object overhead_line { name tail; phases ABCN; from r; to n; length 9000; configuration uneven; }
object load { name n; phases ABCN; nominal_voltage 7200; constant_power_A 500000+200000j;
  constant_power_B 400000+150000j; constant_power_C 450000+100000j; }
object capacitor { name cap; parent n; phases ABCN; pt_phase ABC; phases_connected ABCN; nominal_voltage 7200;
  cap_nominal_voltage 7200; capacitor_A 100 kVAr; capacitor_B 100 kVAr; capacitor_C 100 kVAr; time_delay 15;
  dwell_time 15; switchA OPEN; switchB OPEN; switchC OPEN; CAPACITOR }
"""
)
"""A feeder with a regulator and a capacitor, whose controls are to be put in."""

OUTPUT = "Control OUTPUT_VOLTAGE; control_level INDIVIDUAL; band_center 7440; band_width 120;"
BY_HAND = "control MANUAL;"
VOLT = "control VOLT; control_level BANK; voltage_set_high 7500; voltage_set_low 7300;"
CONTROLS = {
    "output voltage, phase by phase": (OUTPUT, "", BY_HAND),
    "drop of the line": (
        "Control LINE_DROP_COMP; control_level INDIVIDUAL; band_center 122; band_width 2; "
        "current_transducer_ratio 100; power_transducer_ratio 60; compensator_r_setting_A 3; "
        "compensator_r_setting_B 3; compensator_r_setting_C 3; compensator_x_setting_A 5; "
        "compensator_x_setting_B 5; compensator_x_setting_C 5;",
        "",
        BY_HAND,
    ),
    "capacitor by reactive power": (
        "Control MANUAL;",
        "",
        "control VAR; control_level BANK; remote_sense tail; VAr_set_high 80 kVAr; VAr_set_low -90 kVAr;",
    ),
    "volt_var_control": (
        "Control MANUAL;",
        "",
        BY_HAND
        + """ }
object volt_var_control { control_method ACTIVE; regulator_list "reg"; capacitor_list "cap"; substation_link "head";
  voltage_measurements "n,1"; minimum_voltages 7300; maximum_voltages 7500; desired_voltages 7440; max_vdrop 200;
  high_load_deadband 60; low_load_deadband 60; desired_pf 0.98; regulator_delay 5; capacitor_delay 5;""",
    ),
    "both": (OUTPUT, "", VOLT.replace("BANK", "INDIVIDUAL")),
}


def regulated(regulator: str, sense: str, capacitor: str) -> str:
    return REGULATED.replace("REGULATOR", regulator).replace("SENSE", sense).replace("CAPACITOR", capacitor)


def gridlabd_at_50_min(folder: Path, model: str) -> dict[tuple[str, str], complex]:
    """Let GridLAB-D alone run a model for 50 minutes; return its voltages (V)."""
    dump = "object voltdump { filename volts.csv; mode RECT; runtime '2000-01-01 00:50:00'; }\n"
    path = write(folder, model + dump, "alone.glm")
    run = "import gridlabd; g = gridlabd.DirectGridLabD(); g.load_glm(['alone.glm']); g.setup_after_load(); g.run()"
    subprocess.run([sys.executable, "-c", run], cwd=folder, check=True, capture_output=True)
    path.unlink()
    _, *lines = (folder / "volts.csv").read_text().splitlines()
    return {
        (row["node_name"], phase): complex(float(row[f"volt{phase}_real"]), float(row[f"volt{phase}_imag"]))
        for row in csv.DictReader(lines)
        for phase in "ABC"
    }


@pytest.mark.parametrize("what", CONTROLS)
def test_controls_come_to_rest_where_gridlabd_has_them(tmp_path: Path, what: str) -> None:
    """Every voltage is the one that GridLAB-D has after 50 minutes, and a note names the time."""
    model = regulated(*CONTROLS[what])
    theirs = gridlabd_at_50_min(tmp_path, model)

    feeder = read_glm(write(tmp_path, model))

    network = Network(feeder)
    V = solve_power_flow(network, network.closed0)
    differences = [abs(V[k] - theirs[node]) / 7200.0 for k, node in enumerate(network.nodes) if "~" not in node[0]]
    assert len(differences) == 12
    assert max(differences) < TOLERANCE
    assert any("when its regulators and capacitors rest" in note for note in feeder.notes)


def test_controls_that_never_rest_are_told(tmp_path: Path) -> None:
    """A capacitor that hunts stays where it is after an hour; the voltages are GridLAB-D's of that time."""
    capacitor = VOLT.replace("BANK", "INDIVIDUAL").replace("7500", "7265").replace("7300", "7255")

    feeder = read_glm(write(tmp_path, regulated("Control MANUAL;", "", capacitor)))

    (told,) = (note for note in feeder.notes if "an hour after the first moment" in note)
    assert told.startswith("feeder.glm: regulators and capacitors still move at 2000-01-01 01:00:00 UTC")


def test_controls_on_whose_way_gridlabd_has_no_solution_stay(tmp_path: Path) -> None:
    """Where the loads of a later minute have no solution, all is as at the first moment, and a note says so."""
    growing = "schedule growth { 0 * * * * 1; 1-59 * * * * 1e6; }\n"
    model = regulated(*CONTROLS["output voltage, phase by phase"])

    feeder = read_glm(write(tmp_path, growing + model.replace("400000+150000j", "growth*4e5")))

    assert any("stay as at the first moment; GridLAB-D has no solution at 2000" in note for note in feeder.notes)
    assert {part.S for part in feeder.load_parts if part.ends == ("B", "")} == {4e5}
