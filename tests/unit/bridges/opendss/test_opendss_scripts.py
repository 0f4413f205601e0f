"""Scripts as people write them: any encoding, case, folder and quoting; the import writes no file."""

from pathlib import Path

import pytest

from gridpeers.bridges.opendss import read_opendss
from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN, TOLERANCE, largest_difference, write

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

LOAD = "New Load.l bus1=c phases=3 kv=0.48 kw=90 kvar=30\n"


def test_scripts_may_lie_in_folders_and_be_named_in_any_case(tmp_path: Path) -> None:
    """Redirects within redirects are sought beside the script that names them, with either slash, in any case."""
    (tmp_path / "Parts" / "deep").mkdir(parents=True)
    (tmp_path / "Parts" / "Lines.DSS").write_text(LINE + 'redirect "Deep\\Step Down.dss"\n')
    (tmp_path / "Parts" / "deep" / "step down.dss").write_text(STEP_DOWN + "redir ..\\..\\loads.dss ! up again\n")
    (tmp_path / "Loads.dss").write_text(LOAD.upper())

    feeder = read_opendss(write(tmp_path, "REDIRECT (parts/lines.dss)"))

    assert [bus.name for bus in feeder.buses] == ["s", "s~source", "b", "c"]
    assert {part.name for part in feeder.load_parts} == {"load.l"}


def test_compile_within_compile_finds_its_files(tmp_path: Path) -> None:
    """A script that compiles another one, in another folder, is the circuit of that one."""
    (tmp_path / "Case").mkdir()
    inner = write(tmp_path / "Case", "Redirect rest.dss")
    (inner.parent / "rest.dss").write_text(LINE + STEP_DOWN + LOAD)
    outer = tmp_path / "Run.dss"
    outer.write_text('Compile "Case\\Master.dss"\nNew EnergyMeter.m line.head 1\nSolve\nShow voltages\n')

    feeder = read_opendss(outer)

    assert feeder.name == "test"
    assert {part.name for part in feeder.load_parts} == {"load.l"}
    assert any("show was not run" in note for note in feeder.notes)


def test_files_that_a_property_names_are_found(tmp_path: Path) -> None:
    """Matrices, shapes and coordinates in files beside the script are read, with blanks and quotes in their names."""
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "my shape.csv").write_text("0.5\n0.7\n")
    (tmp_path / "data" / "xy.csv").write_text("b, 3, 4\nc, 5, 6\n")
    shape = 'New LoadShape.s npts=2 interval=1 mult=(file="data/my shape.csv")\n'
    (tmp_path / "shapes.dss").write_text(shape)
    path = write(tmp_path, LINE, STEP_DOWN, "Redirect shapes.dss", LOAD + "~ daily=s")
    path.write_text(path.read_text() + "BusCoords data\\XY.csv\n")

    places = {bus.name: (bus.x, bus.y) for bus in read_opendss(path).buses}

    assert places["b"] == (3.0, 4.0)
    assert places["c"] == (5.0, 6.0)


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16"])
def test_a_script_may_be_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    """Names with accents stay apart, whatever the encoding of the script."""
    lines = "\n".join(f"New Line.{name} bus1=b bus2={name} r1=0.1 x1=0.2 length=1" for name in ("São", "Séo"))
    path = write(tmp_path, LINE, lines)
    path.write_bytes(path.read_text().encode(encoding))

    assert len([bus for bus in read_opendss(path).buses if bus.name.startswith("s") and bus.name.endswith("o")]) == 2


def test_names_may_be_strange(tmp_path: Path) -> None:
    """Buses and elements with upper case, blanks in quotes, dashes, numbers and dots in their names come over."""
    strange = """New "Line.A-1.2 (old)" bus1=B.1.2.3 bus2=X_1-2/3#.1.2.3 r1=0.1 x1=0.2 length=1
New "Load.4.5" bus1=X_1-2/3#.2 phases=1 kv=7.2 kw=50 kvar=9
"""
    path = write(tmp_path, LINE, strange)

    assert "x_1-2/3#" in [bus.name for bus in read_opendss(path).buses]
    assert largest_difference(path) < TOLERANCE


def test_the_import_writes_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A script that saves, exports or traces writes nothing to the working folder or beside the script."""
    control = "New RegControl.r transformer=down winding=2 vreg=120 band=2 ptratio=2.3 debugtrace=yes"
    saving = f'Set DataPath="{tmp_path / "made"}"\nExport voltages\nSave circuit dir=saved\nSave voltages\nDump debug'
    path = write(tmp_path, LINE, STEP_DOWN, LOAD, control, saving)
    working = tmp_path / "working"
    working.mkdir()
    monkeypatch.chdir(working)

    read_opendss(path)

    assert sorted(each.name for each in tmp_path.rglob("*")) == ["Master.dss", "working"]


def test_results_of_days_and_years_are_not_computed(tmp_path: Path) -> None:
    """A script that solves a day is read as its snapshot, and a note says what was not run."""
    path = write(tmp_path, LINE, STEP_DOWN, LOAD)
    path.write_text(path.read_text() + "Set mode=daily number=24\nSolve\nSolve mode=yearly\nPlot profile\n")

    feeder = read_opendss(path)

    assert any("solve was not run" in note for note in feeder.notes)
