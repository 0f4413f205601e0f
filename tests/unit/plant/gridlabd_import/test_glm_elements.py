"""Feeders written for GridLAB-D have its voltages after the import, whatever is in them."""

import csv
from math import sqrt
from pathlib import Path

import pytest

from plant.gridlabd.glm_network import network_blocks
from plant.gridlabd_import.glm_loads import V_MIN
from plant.gridlabd_import.read_glm import read_glm
from plant.network import Network, solve_power_flow
from plant.tables import read_feeder
from plant.tables.write import write_feeder
from tests.unit.plant.gridlabd_import.glm_models import (
    LOADS,
    SWITCHES,
    TOLERANCE,
    TRANSFORMERS,
    gridlabd_voltages,
    largest_difference,
    write,
)

pytest.importorskip("gridlabd", reason="the import of .glm files needs the extra gridlabd")

DATA = Path(__file__).parents[4] / "plant" / "data"

CLOCK = """clock { timezone UTC0; starttime '2000-01-01 00:00:00'; stoptime '2000-01-02 00:00:00'; }
module powerflow { solver_method NR; line_capacitance true; }
"""


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize(("model", "count"), [(TRANSFORMERS, 23), (LOADS, 9), (SWITCHES, 16)])
def test_voltages_are_gridlabds(tmp_path: Path, model: str, count: int) -> None:
    """Every voltage is GridLAB-D's within 1e-6 pu."""
    difference, nodes = largest_difference(write(tmp_path, model))

    assert nodes == count
    assert difference < TOLERANCE


def test_our_own_feeder_comes_back(tmp_path: Path) -> None:
    """The 123-node feeder of our tables, written for GridLAB-D and imported, has the voltages of the tables."""
    folder = DATA / "microgrid123"
    table = {path.stem: _rows(path) for path in sorted(folder.glob("*.csv"))}
    table["buses"] = [row for row in table["buses"] if row["bus"] != "610"]  # behind a transformer that is not written
    V_nom = {row["bus"]: float(row["V_nom_kV_LL"]) * 1e3 / sqrt(3.0) for row in table["buses"]}
    path = write(tmp_path, CLOCK + "\n".join(network_blocks(table, "main", V_nom, ())))
    own = Network(read_feeder("microgrid123"))
    V = dict(zip(own.nodes, solve_power_flow(own, own.closed0, tolerance=1e-11).V, strict=True))

    theirs = gridlabd_voltages(path)
    difference, count = largest_difference(path)

    assert difference < TOLERANCE
    assert count >= 270
    for (bus, phase), voltage in theirs.items():
        # closed switches and regulators have 0.14 milliohm each in GridLAB-D, and the feeder's head carries 700 A
        assert abs(V[bus[1:], phase] - voltage) / V_nom[bus[1:]] < 2e-4, bus


def test_tables_of_an_import_are_read_again(tmp_path: Path) -> None:
    """The tables that an import is saved as give the same voltages."""
    feeder = read_glm(write(tmp_path, TRANSFORMERS))
    write_feeder(feeder, tmp_path / "tables")

    first, again = (Network(each) for each in (feeder, read_feeder(str(tmp_path / "tables"))))

    assert first.nodes == again.nodes
    ours, theirs = (solve_power_flow(each, each.closed0).V for each in (first, again))
    assert abs(ours - theirs).max() < 1e-6


def test_constant_power_ends_where_the_voltage_collapses(tmp_path: Path) -> None:
    """Loads of constant power and current have a limit below their usual voltage; impedances need none."""
    parts = read_glm(write(tmp_path, LOADS)).load_parts

    assert {part.exponents for part in parts} == {(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)}
    for part in parts:
        assert part.V_min <= V_MIN
        assert (part.V_min > 0.6) == (part.exponents != (2.0, 2.0))


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
    assert solved.V[network.index("nf", "B")] == 0.0
    solved = solve_power_flow(network, network.closed0 - {names["back"]} | {names["tie"]})
    assert abs(solved.V[network.index("nf", "B")]) > 7000.0
