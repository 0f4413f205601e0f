"""Feeders written for GridLAB-D have its voltages after the import, whatever is in them."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from bench.validation.kirchhoff import kirchhoff_residual
from gridpeers.bridges.gridlabd.glm_elements import V_MIN
from gridpeers.bridges.gridlabd.read_glm import read_glm
from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.plant import installed_inverters
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import read_feeder
from tests.unit.bridges.gridlabd.glm_models import (
    ASYMMETRIC,
    HEAD,
    LOADS,
    SWITCHES,
    TOLERANCE,
    TRANSFORMERS,
    largest_difference,
    network_model,
    write,
)

pytest.importorskip("gridlabd", reason="the import of .glm files needs the extra gridlabd")


@pytest.mark.parametrize(("model", "count"), [(TRANSFORMERS, 23), (LOADS, 9), (SWITCHES, 16), (ASYMMETRIC, 21)])
def test_voltages_are_gridlabds(tmp_path: Path, model: str, count: int) -> None:
    """Every voltage is GridLAB-D's within 1e-6 pu."""
    difference, nodes = largest_difference(write(tmp_path, model))

    assert nodes == count
    assert difference < TOLERANCE


@pytest.mark.parametrize(
    ("phases", "balanced"),
    [
        (("6321.985447626403+3650j", "0-7300j", "-6321.985447626403+3650j"), True),
        (("7300+100j", "-3600-6200j", "-3650+6400j"), False),
    ],
    ids=["turned", "unbalanced"],
)
def test_the_substation_has_the_models_voltages(tmp_path: Path, phases: tuple[str, str, str], balanced: bool) -> None:
    """A substation that is turned, or whose phases differ, feeds as in GridLAB-D; of unequal phases a note tells."""
    first = HEAD.index("  voltage_A")
    last = HEAD.index("\n", first)
    voltages = " ".join(f"voltage_{letter} {V};" for letter, V in zip("ABC", phases, strict=True))
    path = write(tmp_path, SWITCHES.replace(HEAD[first:last], f"  {voltages} }}"))

    assert largest_difference(path)[0] < TOLERANCE
    assert any("its voltages are unbalanced" in note for note in read_glm(path).notes) != balanced


def test_constant_power_ends_where_the_voltage_collapses(tmp_path: Path) -> None:
    """Loads of constant power and current have a limit below their usual voltage; impedances need none."""
    parts = read_glm(write(tmp_path, LOADS)).load_parts

    assert {part.exponents for part in parts} == {(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)}
    for part in parts:
        assert part.V_min <= V_MIN
        assert (part.V_min > 0.6) == (part.exponents != (2.0, 2.0))
        assert part.edge == part.exponents[0] or not part.V_min  # its current does not jump at the limit


def test_switches_are_switches(tmp_path: Path) -> None:
    """Switches and reclosers open and close here, too; a fuse stays, and a note says so."""
    feeder = read_glm(write(tmp_path, SWITCHES), switches=["overhead_line.back"])

    assert {switch.alias: switch.closed for switch in feeder.switches} == {
        "sw": True,
        "rec": True,
        "tie": False,
        "back": True,
    }
    assert "fuse.lateral: stays as it is" in feeder.notes
    network = Network(feeder)
    names = {switch.alias: switch.name for switch in feeder.switches}
    solved = solve_power_flow(network, network.closed0 - {names["back"]})
    assert solved[network.index("nf", "B")] == 0.0
    solved = solve_power_flow(network, network.closed0 - {names["back"]} | {names["tie"]})
    assert abs(solved[network.index("nf", "B")]) > 7000.0


def test_a_nominal_voltage_that_is_wrong_is_told_and_mended(tmp_path: Path) -> None:
    """A bus whose nominal voltage is stated line-to-line has the voltage that GridLAB-D finds there."""
    path = write(
        tmp_path,
        SWITCHES.replace("name ne; phases ABCN; nominal_voltage 7200", "name ne; phases ABCN; nominal_voltage 12470"),
    )

    feeder = read_glm(path)

    assert any(note.startswith("load.ne: nominal_voltage is 12470 V, but 72") for note in feeder.notes)
    assert next(bus.V_nom for bus in feeder.buses if bus.name == "ne") == pytest.approx(7250.0, rel=0.01)
    assert sum(feeder.load_by_bus().values()) == pytest.approx(2.9e5)


@pytest.mark.parametrize(
    ("feeding", "stated"),
    [
        ("object switch { name sw; phases ABCN; from b; to x; operating_mode INDIVIDUAL; phase_B_state OPEN; }", 7200),
        (
            "object fuse { name f; phases ABCN; from b; to x; current_limit 1000; phase_B_status BLOWN; "
            "phase_A_status GOOD; phase_C_status GOOD; }",
            12470,
        ),
    ],
    ids=["switch", "fuse"],
)
def test_a_de_energised_phase_has_no_part_in_a_nominal_voltage(tmp_path: Path, stated: int, feeding: str) -> None:
    """A right nominal voltage stays where a phase is open; in place of a wrong one comes that of the live phases."""
    load = f"object load {{ name x; phases ABCN; nominal_voltage {stated}; constant_impedance_A 300+50j; "
    model = HEAD + feeding + load + "constant_impedance_B 300+50j; constant_impedance_C 300+50j; }\n"

    feeder = read_glm(write(tmp_path, model))

    assert next(bus.V_nom for bus in feeder.buses if bus.name == "x") == pytest.approx(7250.0, rel=0.01)
    assert any("nominal_voltage" in note for note in feeder.notes) == (stated != 7200)


def test_a_node_between_an_impedance_and_its_negative_is_solved(tmp_path: Path) -> None:
    """Our own feeder as we write it for GridLAB-D has such nodes at its regulators: it starts, and is islanded."""
    own = read_feeder("microgrid123")
    feeder = read_glm(write(tmp_path, network_model(own, tmp_path)))
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
    rows = tuple(replace(row, bus=f"n{row.bus}", V_nom=V_nom[f"n{row.bus}"]) for row in own.inverters)
    network = Network(replace(feeder, inverters=rows))
    loads, n = network.loads(), len(rows)
    dynamics = Dynamics(
        circuit_of(network, network.closed0, loads), installed_inverters(network, PlantSettings()), 0.002
    )

    dynamics.start(np.full(n, 0.3), V_set=np.full(n, 1.0))
    assert kirchhoff_residual(dynamics) < 1e-6

    opened = {name for name in network.switches if "13-152" in name}
    dynamics.connect(circuit_of(network, network.closed0 - opened, loads))
    assert len(opened) == 1
    assert dynamics.take_trips() == []
    assert kirchhoff_residual(dynamics) < 1e-6
