"""What cannot be imported is refused by name, several mistakes at once, each in one line that tells what to do."""

import re
import sys
from pathlib import Path

import pytest

from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.tables.read import FeederError
from tests.unit.bridges.opendss.opendss_solutions import LINE, SOURCE, STEP_DOWN, write

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")


def problems(path: Path, leave_out: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Problems of a script that the import refuses."""
    with pytest.raises(FeederError) as refused:
        read_opendss(path, leave_out=leave_out)
    assert all("\n" not in problem for problem in refused.value.problems)
    return refused.value.problems


ONE_LINE = {
    "generation of unequal phases": (
        "New PVSystem.p bus1=c kv=0.48 kva=50 pmpp=40 balanced=yes\nNew Load.l bus1=c.1 phases=1 kv=0.277 kw=60",
        "pvsystem.p: its power is not constant, or differs between phases",
    ),
    "a control of storage": (
        "New Storage.s bus1=c kv=0.48 kwrated=50 kwhrated=100\nNew StorageController.k element=Line.head elementlist=s",
        "storagecontroller.k: class storagecontroller has no counterpart in gridpeers; leave it out",
    ),
    "IndMach012": ("New IndMach012.m bus1=c kv=0.48 kva=50", "--leave-out indmach012.m"),
    "UPFC": ("New UPFC.u bus1=c bus2=d refkv=0.277", "class upfc has no counterpart"),
    "two sources": ("New Vsource.two bus1=c basekv=0.48", "vsource.two: a second source"),
    "a line of no length": ("New Line.z bus1=c bus2=d r1=0.1 x1=0.1 length=0", 'Matrix Inversion Error for Line "z"'),
    "a load on a missing phase": (
        "New Line.z phases=1 bus1=c.1 bus2=d.1 r1=.1 x1=.1 r0=.1 x0=.1\nNew Load.d bus1=d.2 phases=1 kv=0.277 kw=9",
        "load.d: only loads are connected to node 2 of bus d: its phase is missing there",
    ),
    "an open neutral": ("New Load.d bus1=c.1.2.3.4 phases=3 kv=0.48 kw=10", "node 4 of bus c"),
    "a floating section": (
        "New Line.z bus1=e bus2=d r1=.1 x1=.1 r0=.1 x0=.1\nNew Load.d bus1=d kv=0.48 kw=10",
        "buses e, d (first e.1, e.2, e.3): no path to the source, even with all switches closed",
    ),
    "a winding that floats": (
        "New Transformer.t phases=1 xhl=3 buses=(b.1.2 d.1.2) kvs=(12.47 0.48) kvas=(99 99) ppm_antifloat=0\n"
        "New Load.d bus1=d.1.2 phases=1 kv=0.48 kw=10",
        "voltage to ground; ground a winding",
    ),
    "no solution": (
        "New Load.d bus1=c kv=0.48 kw=10000 vminpu=0.01 vlowpu=0.005",
        "Master.dss: the power flow does not converge in the engine",
    ),
    "more nodes than letters": ("New Line.l phases=1 bus1=c.1 bus2=d.60", "bus d: nodes above 58 are not supported"),
    "loads that grow by a curve": (
        "New GrowthShape.g npts=2 year=(1 9) mult=(1.02 1.01)\nNew Load.l bus1=c kv=0.48 kw=9 growth=g\nSet year=3",
        "load.l: growth=g: growth by a GrowthShape is not supported",
    ),
    "a source that is not grounded": (
        "Edit Vsource.source bus2=q.1.2.3\nNew Reactor.q bus1=q phases=3 r=1 x=0",
        "vsource.source: a source needs three phases between nodes 1, 2, 3 of its bus and ground",
    ),
    "a source of another frequency": (
        "New Load.l bus1=c kv=0.48 kw=9\nSet DefaultBaseFrequency=50",
        "vsource.source: has 60 Hz, but the circuit is solved at 50 Hz, so the engine finds 0 V",
    ),
    "a load without voltage": ("New Load.l bus1=c kv=0 kw=9", "load.l: kv must be above 0, got 0 kV"),
    "a load in another unit": (
        "New Load.l bus1=c kv=0.48 kw=1e9 kvar=0 model=2",
        "load.l: 3.33333e+08 kW is not plausible for a load on a phase of 0.48 kV",
    ),
    "a winding without voltage": (
        "New Transformer.t buses=(c d) kvs=(0.48 0) kvas=(99 99)",
        "transformer.t: kv of winding 2 must be above 0, got 0 kV",
    ),
    "a source without voltage": ("Edit Vsource.source pu=0", "vsource.source: pu and basekv must be above 0, got 0"),
    "a circuit without frequency": ("Set Frequency=0", "the circuit's frequency: 0 Hz is not plausible"),
    "a script that includes itself": ("Redirect Master.dss", "Master.dss:11: includes itself"),
    "another linecode": (
        "New Line.l bus1=c bus2=d linecode=nope",
        'Master.dss:11: Line.l.LineCode: LineCode object "nope"',
    ),
}


OF_THE_WHOLE = ("no solution", "a winding that floats")  # problems that no line of a script has


@pytest.mark.parametrize("what", ONE_LINE)
def test_one_line_says_what_is_refused(tmp_path: Path, what: str) -> None:
    """Each thing that cannot be represented is named, in one line with the script's file and line."""
    script, told = ONE_LINE[what]

    (problem,) = problems(write(tmp_path, LINE, STEP_DOWN, script))

    assert told in problem
    assert re.match(r"Master\.dss:\d+: ", problem) or what in OF_THE_WHOLE


def test_all_mistakes_of_a_script_come_at_once(tmp_path: Path) -> None:
    """Everything that the engine refuses is told, with file and line, and files that are not there."""
    (tmp_path / "loads.dss").write_text("New Load.a bus1=c kws=9\n\nfoo bar\n")
    path = write(tmp_path, "New Lode.x bus1=b", "Redirect loads.dss", "Redirect 'not there.dss'", "Compile gone.dss")

    said = problems(path)

    assert [problem.partition(" ")[0] for problem in said] == [
        "Master.dss:4:",
        "loads.dss:1:",
        "loads.dss:3:",
        "Master.dss:6:",
        "Master.dss:7:",
    ]
    assert 'Unknown parameter "kws"' in said[1]
    assert "includes not there.dss, which does not exist" in said[3]


def test_all_that_is_not_supported_comes_at_once(tmp_path: Path) -> None:
    """Machines, unsupported classes and loads without a phase are told together."""
    scripts = [ONE_LINE[what][0] for what in ("IndMach012", "UPFC", "two sources", "an open neutral")]

    assert len(problems(write(tmp_path, LINE, STEP_DOWN, *scripts))) == 4


def test_what_is_left_out_is_no_problem(tmp_path: Path) -> None:
    """`leave_out` does without elements by name or pattern; a pattern that matches nothing is told."""
    path = write(tmp_path, LINE, STEP_DOWN, ONE_LINE["IndMach012"][0], ONE_LINE["UPFC"][0])

    read_opendss(path, leave_out=["IndMach012.*", "upfc.u"])
    (problem,) = problems(path, leave_out=("IndMach012.*", "upfc.u", "Generator.*"))

    assert 'leave_out: "Generator.*" matches no element' in problem


def test_a_script_without_a_circuit_is_told(tmp_path: Path) -> None:
    """A script that makes no circuit, a file of bytes and a missing file end in few lines, not in thousands."""
    path = tmp_path / "x.dss"
    path.write_text("Clear\nSet DefaultBaseFrequency=60\n")
    assert problems(path) == ("x.dss: makes no circuit; write a line New Circuit.name",)

    for data in (bytes(range(256)) * 200, b"module powerflow;\nobject node { name a; phases ABCN; }\n"):
        path.write_bytes(data)
        assert len(problems(path)) <= 4

    (missing,) = problems(tmp_path / "missing.dss")
    assert "there is no such file" in missing
    (folder,) = problems(tmp_path)
    assert "is a folder; name the file in it" in folder


def test_a_source_of_one_phase_is_told(tmp_path: Path) -> None:
    """A circuit whose only source has one phase, or none because it is left out, is refused in one line."""
    path = tmp_path / "x.dss"
    path.write_text("New Circuit.x bus1=s phases=1 basekv=7.2\nNew Load.l bus1=s.1 phases=1 kv=7.2 kw=9\nSolve\n")

    assert problems(path) == (
        "x.dss:1: vsource.source: a source needs three phases between nodes 1, 2, 3 of its bus and ground",
    )
    assert problems(path, ("vsource.source",))[-1].startswith("no Vsource")


def test_switches_and_frequency_that_are_wrong_are_told(tmp_path: Path) -> None:
    """A line to be a switch that does not exist, and a frequency that is not the script's, are told together."""
    path = write(tmp_path, LINE)

    with pytest.raises(FeederError) as refused:
        read_opendss(path, f_nom=50.0, switches=["Line.hed"])

    assert len(refused.value.problems) == 2


def test_a_missing_wheel_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the engine one line says what to install."""
    monkeypatch.setitem(sys.modules, "dss", None)

    assert problems(write(tmp_path, LINE)) == (
        "reading .dss files needs the OpenDSS engine; install it: pip install -e '.[opendss]'",
    )


def test_a_load_that_is_hardly_meant_for_its_voltage_is_a_note(tmp_path: Path) -> None:
    """A load far from its kv does not take its power."""
    path = tmp_path / "Master.dss"
    load = "New Load.l bus1=c phases=1 kv=0.12 kw=1"
    path.write_text(f"{SOURCE}{LINE}{STEP_DOWN}{load}\nSet VoltageBases=(12.47 0.48)\nCalcVoltageBases\nSolve\n")

    (told,) = read_opendss(path).notes

    assert told.startswith("load.l: its voltage is 2.4 times its kv")
