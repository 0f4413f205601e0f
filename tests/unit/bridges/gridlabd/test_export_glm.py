"""A feeder as a model for GridLAB-D."""

import csv
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.bridges.gridlabd.glm import inverter_blocks
from gridpeers.bridges.gridlabd.gridlabd_simulator import unrepresentable
from gridpeers.bridges.gridlabd.read_glm import read_glm
from gridpeers.plant.equipment import Load, Tables
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.inverter_model import InverterModel
from gridpeers.plant.inverters.inverter_registry import BOUNDS_OF_SET_POINTS
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.tables import read_feeder
from gridpeers.wire.schema.table_schema import Field, fields_of
from tests.unit.bridges.gridlabd.glm_models import LOADS, network_model, write

DUMP = '\nobject voltdump { filename "voltages.csv"; mode RECT; }'
TOLERANCE = 1e-8  # largest difference (pu); GridLAB-D writes 1e-6 V, which is 4e-10 pu
RUN = """import gridlabd
model = gridlabd.DirectGridLabD()
model.load_glm(["model.glm"])
model.setup_after_load()
assert model.run() == gridlabd.GLDErrorCode.SUCCESS
"""


def voltages(text: str, folder: Path) -> dict[str, list[complex]]:
    """Run a model in the stock wheel; return the phasors A, B, C (V) of its nodes at the start."""
    pytest.importorskip("gridlabd", reason="GridLAB-D comes with the extra gridlabd")
    (folder / "model.glm").write_text(text)
    subprocess.run([sys.executable, "-c", RUN], cwd=folder, check=True, capture_output=True, timeout=100)
    with (folder / "voltages.csv").open(newline="") as stream:
        rows = [row for row in csv.reader(stream) if len(row) == 7][1:]
    return {name: [complex(float(a), float(b)) for a, b in list(pairwise(values))[::2]] for name, *values in rows}


def largest_difference(feeder: Tables, theirs: dict[str, list[complex]]) -> float:
    """Largest difference (pu) over all nodes of a power flow; behind a delta winding, over phase to phase."""
    network = Network(feeder)
    V = solve_power_flow(network, network.closed0)
    floating = {row.to_bus for row in feeder.transformers if row.connection == "D-D"}
    gaps = []
    for bus in feeder.buses:
        index = [network.index(bus.name, phase) for phase in bus.phases]
        gap = V[index] - [theirs[f"n{bus.name}"]["ABC".index(phase)] for phase in bus.phases]
        gaps.append(np.abs(gap - gap.mean() if bus.name in floating else gap).max() / bus.V_nom)
    assert len(gaps) == len(feeder.buses) > 100
    return float(max(gaps))


def test_transformers_and_regulators_of_any_ratio_are_exported(tmp_path: Path) -> None:
    """IEEE 123 with a loaded grounded transformer, and regulators between two taps, has our voltages in GridLAB-D."""
    feeder = read_feeder("standard123")
    ratios = {"reg1": 1.0321, "reg2": 0.9875}
    feeder = replace(
        feeder,
        transformers=tuple(replace(row, connection="Yg-Yg") for row in feeder.transformers),
        regulators=tuple(replace(row, ratio=ratios.get(row.name, row.ratio)) for row in feeder.regulators),
        loads=(*feeder.loads, Load(bus="610", connection="Y", model="P", S=(40e3 + 1e4j, 2e4 + 0j, 3e4 + 2e4j))),
    )

    theirs = voltages(network_model(feeder, tmp_path) + DUMP, tmp_path)

    assert largest_difference(feeder, theirs) < TOLERANCE


def test_everything_that_gridlabd_cannot_represent_is_named_at_once(tmp_path: Path) -> None:
    """No substation, another frequency, names that it does not take, two inverters at a bus; an imported feeder."""
    feeder = read_feeder("microgrid123")
    first, second, *others = feeder.inverters
    inverters = (replace(first, name="1.st"), second, *others, replace(others[2], name="leg", bus="80", phases="B"))

    assert unrepresentable(replace(feeder, source=None, f_nom=50.0, inverters=inverters)) == [
        "microgrid123 has no source.csv; GridLAB-D needs a substation as its swing bus",
        "microgrid123 has 50 Hz; the model is written for 60 Hz",
        'bus "80" has inv4, leg; GridLAB-D takes one inverter a bus: give each a bus behind a line',
        'inverter "1.st": GridLAB-D takes letters, digits, _ and - for a name; rename it',
    ]
    (imported,) = unrepresentable(read_glm(write(tmp_path, LOADS)))
    assert "was imported: its elements are admittance matrices" in imported


DEFAULT: dict[str, type[InverterModel]] = {"GFM": GfmDroop, "GFL": Gfl}
ROW = {"name": "inv1", "bus": "13", "P_rated_kW": "600", "m_p_pu": "0.01", "m_q_pu": "0.05"}
KEYS = [
    (kind, field)
    for kind, cls in DEFAULT.items()
    for field in fields_of(cls)
    if field.name not in {"folder", *BOUNDS_OF_SET_POINTS}  # they bound set-points before GridLAB-D gets them
]


def another(field: Field) -> Any:
    """Return another value of a parameter than its default."""
    if field.type is bool:
        return not field.default
    if field.name == "model":
        return {"gridlabd": "regfm_a1", "voltage_source": "current_source"}[field.default]
    if get_origin(field.type) is Literal:
        return next(word for word in get_args(field.type) if word != field.default)
    return 0.5 * field.default or 0.01


@pytest.mark.parametrize(("kind", "field"), KEYS, ids=[f"{kind}-{field.key}" for kind, field in KEYS])
def test_a_parameter_is_written_or_refused(kind: str, field: Field) -> None:
    """Another value of any parameter makes another model; one that GridLAB-D does not have is named by its key."""
    default = DEFAULT[kind]()
    own = replace(default, **{field.name: another(field)})

    models = [
        inverter_blocks([ROW | {"kind": kind}], {"inv1": 1e5 + 0j}, {"inv1": parameters})
        for parameters in (default, own)
    ]

    assert (models[0] != models[1]) != (field.key in own.beyond_gridlabd())
    assert default.beyond_gridlabd() == {}
