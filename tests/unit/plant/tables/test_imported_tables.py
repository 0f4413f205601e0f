"""Tables of an imported feeder: wrong cells of elements and parts of loads are told, and never dropped."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest

from gridpeers.plant.tables import FeederError, read_feeder
from gridpeers.plant.tables.read import DATA


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of ieee34 to break."""
    return Path(shutil.copytree(DATA / "ieee34", tmp_path / "mine"))


def problems(folder: Path, file: str, **cells: str) -> tuple[str, ...]:
    """Problems of the feeder with other cells in the first row of a table."""
    with (folder / file).open(newline="") as stream:
        table = list(csv.DictReader(stream))
    table[0] |= cells
    with (folder / file).open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(table[0]))
        writer.writeheader()
        writer.writerows(table)
    with pytest.raises(FeederError) as caught:
        read_feeder(str(folder))
    return caught.value.problems


@pytest.mark.parametrize("node", ["814.AB", "814.", "814", ".A"])
def test_a_node_that_is_not_a_bus_and_one_phase_is_told(folder: Path, node: str) -> None:
    """An element is not left out because its node cannot be read."""
    told = problems(folder, "elements.csv", nodes=node, Y_S="1")

    assert told == (f'elements.csv row 2: nodes: "{node}" is no node; write a bus and one of its phases, as "650.A"',)


@pytest.mark.parametrize(("cells", "told"), [
    ({"from_phase": "ABC"}, 'from_phase: "ABC" must be one phase (as "A"); give each phase a row of its own'),
    ({"to_phase": "AA"}, 'to_phase: "AA" must be one phase (as "A"); give each phase a row of its own'),
    ({"V_max_pu": "0.5"}, "V_max_pu: 0.5 pu must be above V_min_pu, 0.8 pu"),
    ({"P_kW": "1e9"}, "P_kW: 1e+09 kW is not plausible for a load on a phase of 24.9 kV"),
    ({"Q_kvar": "-1e9"}, "Q_kvar: -1e+09 kvar is not plausible for a load on a phase of 24.9 kV"),
])  # fmt: skip
def test_a_part_of_a_load_with_a_wrong_cell_is_told(folder: Path, cells: dict[str, str], told: str) -> None:
    """A part is between two nodes or one and ground, within limits in their order, and of a power that a feeder has."""
    (problem,) = problems(folder, "load_parts_main.csv", **cells)

    assert problem.startswith(f"load_parts_main.csv row 2: {told}")


def test_a_rating_in_another_unit_is_told_beside_the_parts_of_loads(folder: Path) -> None:
    """The parts of an imported feeder's loads are its load, beside which a rating of 200 MW makes no sense."""
    (problem,) = problems(folder, "inverters.csv", P_rated_kW="200000")

    assert "200000 kW is not plausible for an inverter" in problem
    assert "beside 1769 kW of load" in problem
