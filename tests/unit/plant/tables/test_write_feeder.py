"""Tables that are written, and those of feeders from other programs."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from gridpeers.feeder import Feeder
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.tables import FeederError, read_feeder
from gridpeers.plant.tables.read import DATA


@pytest.mark.parametrize("name", ["microgrid123", "standard123"])
def test_own_tables_survive_writing(name: str, tmp_path: Path) -> None:
    """Every table of ours keeps its rows; the voltages agree to rounding."""
    feeder = Feeder.read(name)
    again = Feeder.read(feeder.save(tmp_path / name))

    for field in ("lines", "line_configs", "switches", "loads", "capacitors", "regulators", "transformers"):
        assert len(getattr(again, field)) == len(getattr(feeder, field)), field
    assert [bus.name for bus in again.buses] == [bus.name for bus in feeder.buses]
    assert (again.inverters, again.spares, again.source) == (feeder.inverters, feeder.spares, feeder.source)
    for transformer, read in zip(feeder.transformers, again.transformers, strict=True):
        assert read.z == pytest.approx(transformer.z)
    one, other = (Network(each) for each in (feeder, again))
    V, W = (solve_power_flow(network, network.closed0) for network in (one, other))
    np.testing.assert_allclose(W, V, rtol=1e-11)


def test_limits_of_imported_loads_and_the_substations_angle_survive_writing(tmp_path: Path) -> None:
    """Every field of a load's part is read as it was written, and the angle in radians."""
    feeder = Feeder.read("ieee34")
    first, *others = feeder.load_parts
    limits = {"V_low": 0.5, "V_min": 0.8, "V_max": 1.1, "edge": 1.0, "V_off": 0.7, "V_off_above": 1.3}
    part = msgspec.structs.replace(first, S=3e3 + 1e3j, exponents=(0.8, 3.0), **limits)
    assert feeder.source is not None
    source = msgspec.structs.replace(feeder.source, angle=0.5)
    feeder = msgspec.structs.replace(feeder, load_parts=(part, *others), source=source)

    again = Feeder.read(feeder.save(tmp_path / "mine"))

    assert again.source is not None
    assert again.source.angle == pytest.approx(0.5)
    for name in part.__struct_fields__:
        written, read = getattr(part, name), getattr(again.load_parts[0], name)
        assert read == (written if name in ("name", "bus", "ends") else pytest.approx(written))


def test_an_inverter_added_to_a_feeder_of_ours_is_saved(tmp_path: Path) -> None:
    """A scenario can name a feeder that `add_inverter` returned, once it is saved."""
    feeder = Feeder.read("microgrid123").add_inverter("inv11", bus="87", kind="GFL", P_rated=2e5)
    for phase in "ABC":
        feeder = feeder.add_inverter(f"leg{phase}", bus="47", kind="GFM", P_rated=5e4, phases=phase)  # type: ignore[arg-type]
    feeder = feeder.add_inverter("lateral", bus="96", kind="GFL", P_rated=5e4, phases="B")

    assert Feeder.read(feeder.save(tmp_path / "mine")).inverters == feeder.inverters
    assert [row.phases for row in feeder.inverters[-5:]] == ["ABC", "A", "B", "C", "B"]
    alone = msgspec.structs.replace(feeder, source=None, inverters=feeder.inverters[-4:-1], spares=())
    assert len(Feeder.read(alone.save(tmp_path / "alone")).inverters) == 3


@pytest.mark.parametrize(("wrong", "said"), [
    ({"kind": "gfm"}, 'inverter "inv11": kind "gfm": no such kind'),
    ({"P_rated": -1.0, "m_p": 0.0}, "P_rated_kW: .* above 0.*; .*m_p_pu: .* above 0"),
    ({"P_rated": 200.0}, "P_rated_kW: 0.2 kW is not plausible"),
    ({"name": "a/b"}, "cannot be part of a Zenoh key"),
    ({"bus": "96", "m_p": 0.0}, 'm_p_pu: .* above 0.*; .*bus "96" has no phase A, C; it has B'),
    ({"bus": "96", "phases": "C"}, 'bus "96" has no phase C; it has B'),
    ({"phases": "AB"}, 'phases "AB": must be "ABC" or "A" or "B" or "C"'),
    ({"phases": 3}, 'phases "3": must be "ABC" or "A" or "B" or "C"'),
    ({"P_rated": "much"}, "could not convert string to float"),
    ({"m_p": None}, 'm_p_pu must be a number, got "None"'),
    ({"name": None, "microgrid": None}, "name is empty; .*microgrid is empty; give a name"),
    ({"name": 1, "kind": 2}, 'inverter "1": kind "2": no such kind'),
    ({"params": "slow"}, 'parameters "slow": no such set'),
    ({"bus": "610", "phases": "A"}, 'bus "610" is behind a delta winding without ground'),
    ({"name": "inv1", "bus": "160", "phases": "B"}, 'must differ; .*has inverter "inv1" on phase B already'),
])  # fmt: skip
def test_an_inverter_that_the_tables_would_refuse_is_not_added(wrong: dict[str, Any], said: str) -> None:
    """The error comes at the call, not from a row of a file that is written later."""
    with pytest.raises(ValueError, match=said):
        Feeder.read("microgrid123").add_inverter(
            **{"name": "inv11", "bus": "87", "kind": "GFL", "P_rated": 2e5} | wrong
        )


def test_saving_a_feeder_removes_former_tables_of_its_folder(tmp_path: Path) -> None:
    feeder = Feeder.read("microgrid123")
    folder = feeder.save(tmp_path / "mine")
    (folder / "README.md").write_text("mine")
    bare = msgspec.structs.replace(feeder, capacitors=())
    again = Feeder.read(bare.save(folder))

    assert again.capacitors == ()
    assert (folder / "README.md").is_file()


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


NODE = 'nodes: "{}" is no node; write a bus and one of its phases, as "650.A"'


@pytest.mark.parametrize(("file", "cells", "told"), [
    *(("elements.csv", {"nodes": text, "Y_S": "1"}, NODE.format(text)) for text in ("814.AB", "814.", "814", ".A")),
    ("load_parts_main.csv", {"from_phase": "ABC"}, 'from_phase: "ABC" must be one phase (as "A"); give each phase a'),
    ("load_parts_main.csv", {"to_phase": "AA"}, 'to_phase: "AA" must be one phase (as "A"); give each phase a'),
    ("load_parts_main.csv", {"V_max_pu": "0.5"}, "V_max_pu: 0.5 pu must be above V_min_pu, 0.8 pu"),
    ("load_parts_main.csv", {"P_kW": "1e9"}, "P_kW: 1e+09 kW is not plausible for a load on a phase of 24.9 kV"),
    ("load_parts_main.csv", {"Q_kvar": "-1e9"}, "Q_kvar: -1e+09 kvar is not plausible for a load on a phase "),
    ("inverters.csv", {"P_rated_kW": "200000"}, "P_rated_kW: 200000 kW is not plausible for an inverter"),
])  # fmt: skip
def test_a_wrong_cell_of_an_imported_feeder_is_a_problem(
    folder: Path, file: str, cells: dict[str, str], told: str
) -> None:
    """No element is left out; a part of a load is between two nodes or one and ground, within limits."""
    (problem,) = problems(folder, file, **cells)

    assert problem.startswith(f"{file} row 2: {told}")
