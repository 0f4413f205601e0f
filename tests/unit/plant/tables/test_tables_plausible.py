"""Numbers that only a lost unit explains, names that cannot go on the wire, and feeders that hang together."""

import csv
import shutil
from pathlib import Path

import pytest

from gridpeers.plant.tables import FeederError, feeders, read_feeder
from gridpeers.plant.tables.read import DATA


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of microgrid123 to break."""
    return Path(shutil.copytree(DATA / "microgrid123", tmp_path / "mine"))


def edit(folder: Path, file: str, row: int, **cells: str) -> None:
    """Change cells of one row; the header is row 1."""
    with (folder / file).open(newline="") as stream:
        table = list(csv.DictReader(stream))
    table[row - 2] |= cells
    with (folder / file).open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(table[0]))
        writer.writeheader()
        writer.writerows(table)


def drop(folder: Path, file: str, start: str) -> None:
    """Take out the one row that begins so."""
    lines = (folder / file).read_text().splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith(start)]
    assert len(kept) == len(lines) - 1
    (folder / file).write_text("".join(kept))


def problems(folder: Path) -> tuple[str, ...]:
    """Problems of a broken feeder."""
    with pytest.raises(FeederError) as caught:
        read_feeder(str(folder))
    return caught.value.problems


IMPLAUSIBLE: list[tuple[str, int, dict[str, str], str]] = [
    ("inverters.csv", 2, {"P_rated_kW": "600000"}, "did you mean 600 (600000 W)?"),
    ("inverters.csv", 2, {"P_rated_kW": "0.6"}, "did you mean 600 (0.6 MW)?"),
    ("inverters.csv", 2, {"m_p_pu": "1"}, "1 pu is not plausible for a P-f droop (0.001 to 0.2 pu); did you mean 0.01"),
    ("inverters.csv", 2, {"m_q_pu": "5"}, "did you mean 0.05 (5 %)?"),
    ("inverters.csv", 2, {"m_p_pu": "1e-9"}, "1e-09 pu is not plausible for a P-f droop"),
    ("buses.csv", 3, {"V_nom_kV_LL": "4160"}, "did you mean 4.16 (4160 V)?"),
    ("lines.csv", 4, {"length_m": "1e9"}, "1e+09 m is not plausible for the length of a line"),
    ("lines.csv", 4, {"length_m": "0.0914"}, "did you mean 91.4 (0.0914 km)?"),
    ("line_configs.csv", 2, {"R_ohm_per_km": "284"}, "did you mean 0.284 (284 ohm/1000 km)?"),
    ("line_configs.csv", 3, {"X_ohm_per_km": "2.3"}, 'config "1" has an X matrix that no line has'),
    ("loads_main.csv", 2, {"P_a_kW": "40000"}, "did you mean 40 (40000 W)?"),
    ("loads_main.csv", 2, {"Q_a_kvar": "-20000"}, "did you mean -20 (-20000 var)?"),
    ("capacitors.csv", 3, {"Q_a_kvar": "50000"}, "did you mean 50 (50000 var)?"),
    ("capacitors.csv", 3, {"V_rated_kV_LN": "4.16"}, "did you mean 2.40178 (4.16 kV line-to-line)?"),
    ("transformers.csv", 2, {"S_rated_kVA": "150000"}, "did you mean 150 (150000 VA)?"),
    ("transformers.csv", 2, {"X_percent": "0.0272"}, "did you mean 2.72 (0.0272 pu)?"),
    ("regulators.csv", 3, {"tap": "100"}, "tap and tap_step_pu give a ratio of 1.625; 0.8 to 1.25 makes sense"),
    ("source.csv", 2, {"V_pu": "100"}, "did you mean 1 (100 %)?"),
    ("source.csv", 2, {"angle_deg": "1e6"}, "1e+06 deg is not plausible for the angle of the substation"),
]


@pytest.mark.parametrize(("file", "row", "cells", "told"), IMPLAUSIBLE, ids=[f"{m[0]}-{m[2]}" for m in IMPLAUSIBLE])
def test_a_number_off_by_its_unit_is_refused_with_what_was_meant(
    folder: Path, file: str, row: int, cells: dict[str, str], told: str
) -> None:
    """A number that is a thousand times too large or small is refused where it stands, not found by a solver later."""
    edit(folder, file, row, **cells)

    found = [problem for problem in problems(folder) if "between buses of" not in problem]

    assert len(found) == 1, found
    assert told in found[0]
    assert found[0].startswith(file)


@pytest.mark.parametrize("name", ["PV 2", "pv/2", "a*", "é", "x" * 65, "plant", "grid", "off"])
def test_a_name_that_cannot_go_on_the_wire_is_refused_in_the_table(folder: Path, name: str) -> None:
    """An inverter's name is a part of keys, and neither the plant's nor that of the grid's island."""
    edit(folder, "inverters.csv", 3, name=name)

    (found,) = problems(folder)

    assert found.startswith(f'inverters.csv row 3: name "{name}"'), found


def test_control_characters_in_a_name_are_refused(folder: Path) -> None:
    """A name is printed to terminals, so it has no escape sequences in it."""
    edit(folder, "inverters.csv", 3, microgrid="MG\x1b[31m1")

    (found,) = problems(folder)

    assert found.startswith("inverters.csv row 3: microgrid ")
    assert "\x1b" not in found


def test_a_missing_line_is_told_with_the_buses_it_cuts_off(folder: Path) -> None:
    """A feeder is one network when all its switches are closed; what hangs on nothing is named."""
    drop(folder, "lines.csv", "L67_72,")

    (found,) = problems(folder)

    assert found.startswith("buses.csv: 23 buses are not connected with the substation at bus 150: 72 phase B, C, 73, ")
    assert "(with inv4, inv5, inv6)" in found
    assert "a line, switch, regulator or transformer is missing" in found


def test_a_line_that_lacks_a_phase_is_told(folder: Path) -> None:
    """Phases are followed one by one: B and C of what lies behind a single-phase line are not fed."""
    lines = (folder / "lines.csv").read_text()
    assert "L29_30,29,30,ABC,2," in lines
    (folder / "lines.csv").write_text(lines.replace("L29_30,29,30,ABC,2,", "L29_30,29,30,A,9,"))

    (found,) = problems(folder)

    assert "2 buses are not connected with the substation at bus 150: 30 phase B, C, 250 phase B, C;" in found


@pytest.mark.parametrize("feeder", feeders())
def test_the_feeders_that_come_with_the_package_are_plausible(feeder: str) -> None:
    """No bound refuses the feeders of the package, in any of their load sets."""
    sets = [path.stem.removeprefix("loads_") for path in (DATA / feeder).glob("loads_*.csv")]

    assert all(read_feeder(feeder, load_set).buses for load_set in sets)


def test_a_feeder_without_buses_is_told_once(folder: Path) -> None:
    """An empty table of buses is one problem, not one for every reference into it."""
    (folder / "buses.csv").write_text("bus,phases,V_nom_kV_LL\n")

    assert problems(folder) == ("buses.csv: has no rows; a feeder needs at least one bus",)


def test_a_column_given_twice_is_told_once(folder: Path) -> None:
    """Which of two columns of one name counts, nobody knows."""
    text = (folder / "lines.csv").read_text().replace("origin,note", "length_m,note", 1)
    (folder / "lines.csv").write_text(text)

    assert problems(folder) == ('lines.csv: column "length_m" stands there twice; keep one',)
