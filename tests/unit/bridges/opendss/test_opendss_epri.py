"""The import against EPRI's own engine (in C++), beside that of dss-python (in Pascal)."""

import importlib.util
from pathlib import Path

import pytest

from bench.validation.opendss_engines import solve_scripts
from bench.validation.write_opendss import write_opendss
from gridpeers.plant.tables import read_feeder
from tests.unit.bridges.opendss.opendss_scripts import ELEMENTS, LINES, LOAD_SCRIPTS, LOADS, TRANSFORMERS
from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN, TOLERANCE, largest_difference, write

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")
if importlib.util.find_spec("py_dss_interface") is None:
    pytest.skip("EPRI's engine comes with the extra validation (py-dss-interface)", allow_module_level=True)

FEEDERS = Path(__file__).parents[3] / "feeders"

FEEDER_NAMES = ("ieee13", "ieee34", "standard123")

SCRIPTS: dict[str, tuple[str, ...]] = {
    **{f"transformer, {name}": (TRANSFORMERS[name],) for name in TRANSFORMERS},
    **{f"line, {name}": (STEP_DOWN, LOADS, LINES[name]) for name in LINES},
    **{name: (STEP_DOWN, LOADS, ELEMENTS[name]) for name in ELEMENTS},
    **{name: (STEP_DOWN, script) for name, script in LOAD_SCRIPTS.items()},
}


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, dict[str, complex]]]:
    """Each circuit's script, and its voltages by EPRI's engine, all from one process of it."""
    folder = tmp_path_factory.mktemp("epri")
    paths = {name: FEEDERS / f"{name}.dss" for name in FEEDER_NAMES}
    paths["standard123"] = folder / "standard123.dss"
    paths["standard123"].write_text(write_opendss(read_feeder("standard123")))
    for number, (name, parts) in enumerate(SCRIPTS.items()):
        (folder / str(number)).mkdir()
        paths[name] = write(folder / str(number), LINE, *parts)
    solved = solve_scripts("py-dss-interface", [(path, [()]) for path in paths.values()])
    return {name: (path, each.state(0)) for (name, path), each in zip(paths.items(), solved, strict=True)}


@pytest.mark.parametrize("name", [*FEEDER_NAMES, *SCRIPTS])
def test_the_import_has_the_voltages_of_epris_engine(
    solved: dict[str, tuple[Path, dict[str, complex]]], name: str
) -> None:
    """Feeders, transformers, lines, capacitors and loads of all kinds have the voltages of EPRI's engine, too."""
    path, theirs = solved[name]

    assert largest_difference(path, theirs) < TOLERANCE
