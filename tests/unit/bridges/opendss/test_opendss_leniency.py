"""Scripts as utilities export them: what a snapshot of the fed network does without becomes a note, and no refusal."""

from pathlib import Path

import pytest

from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.tables import read_feeder
from gridpeers.plant.tables.read import FeederError
from gridpeers.plant.tables.write import write_feeder
from tests.unit.bridges.opendss.opendss_solutions import (
    LINE,
    SOURCE,
    STEP_DOWN,
    TOLERANCE,
    engine_voltages,
    our_voltages,
    write,
)

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

LOAD = "New Load.l bus1=c phases=3 kv=0.48 kw=90 kvar=30"
FLOATING = "New Line.z bus1=e bus2=d r1=.1 x1=.1 r0=.1 x0=.1\nNew Load.d bus1=d kv=0.48 kw=10"
SPUR = "New Line.y phases=1 bus1=c.1 bus2=f.1 r1=.1 x1=.1 r0=.1 x0=.1"


def unlike(path: Path) -> float:
    """Return the largest difference (pu) from the engine over the nodes that the import has."""
    theirs, (ours, nominal) = engine_voltages(path), our_voltages(path)
    shared = theirs.keys() & ours.keys()
    assert len(shared) >= 6
    return max(abs(ours[name] - theirs[name]) / nominal[name] for name in shared)


@pytest.mark.parametrize(("parts", "note"), [
    pytest.param(
        (FLOATING,), "buses e, d (first e.1, e.2, e.3): no path to the source; left out, with 10 kW", id="section"
    ),
    pytest.param(
        (SPUR, "New Load.m bus1=f.2 phases=1 kv=0.277 kw=9"), "load.m: nothing else is connected", id="phase"
    ),
    pytest.param(
        (SPUR, "New Load.m bus1=f.1.2 phases=1 conn=delta kv=0.48 kw=9"),
        "load.m: nothing else is connected",
        id="loose end",
    ),
])  # fmt: skip
def test_what_nothing_feeds_is_left_out(tmp_path: Path, parts: tuple[str, ...], note: str) -> None:
    """A floating section, and loads on a missing phase or with a loose end, take nothing; the rest is the engine's."""
    path = write(tmp_path, LINE, STEP_DOWN, LOAD, *parts)

    (found,) = read_opendss(path).notes

    assert found.startswith(note)
    assert unlike(path) < TOLERANCE


def test_a_load_through_which_current_can_flow_is_refused(tmp_path: Path) -> None:
    """A delta load with one corner on a missing phase still joins the two others: it is no load without current."""
    path = write(tmp_path, LINE, STEP_DOWN, LOAD, "New Line.y phases=2 bus1=c.1.2 bus2=f.1.2 r1=.1 x1=.1 r0=.1 x0=.1")
    path.write_text(
        path.read_text().replace("Set Volt", "New Load.m bus1=f phases=3 conn=delta kv=0.48 kw=9\nSet Volt")
    )

    with pytest.raises(FeederError, match=r"load\.m: only loads are connected to node 3 of bus f"):
        read_opendss(path)


def test_most_of_the_load_is_not_left_out(tmp_path: Path) -> None:
    """A section with most of the load is a mistake in the script, which is refused."""
    path = write(tmp_path, LINE, STEP_DOWN, LOAD.replace("kw=90", "kw=9"), FLOATING)

    with pytest.raises(FeederError, match="no path to the source, even with all switches closed"):
        read_opendss(path)


def test_files_that_a_snapshot_does_not_need_may_be_missing(tmp_path: Path) -> None:
    """Missing coordinates, load shapes and a monitor of nothing become notes, each with its file and line."""
    shape = "New Loadshape.s npts=2 interval=1\n~ mult=(file=gone.csv)"
    path = write(
        tmp_path, LINE, STEP_DOWN, shape, LOAD + " daily=s", "New Monitor.m element=line.gone", "Buscoords gone.xy"
    )

    notes = read_opendss(path).notes

    assert [note.partition(" ")[0] for note in notes] == ["Master.dss:12:", "Master.dss:14:", "Master.dss:15:"]
    assert unlike(path.with_name(_without(path, "gone"))) < TOLERANCE


def _without(path: Path, word: str) -> str:
    """Write the script without the lines that have a word, and return its name."""
    lines = [line for line in path.read_text().splitlines() if word not in line]
    path.with_name("whole.dss").write_text("\n".join(lines))
    return "whole.dss"


def test_controls_that_hunt_stay_where_they_are(tmp_path: Path) -> None:
    """Capacitor controls that switch each other for ever are a note; the import has the positions of the end."""
    bank = "New Capacitor.k bus1=c phases=3 kvar=100 kv=0.48"
    control = "New CapControl.x element=Transformer.down capacitor=k type=kvar ctratio=1 onsetting=30 offsetting=20"
    notes = read_opendss(write(tmp_path, LINE, STEP_DOWN, LOAD, bank, control)).notes

    assert any("its controls hunt" in note for note in notes)


def test_tables_of_an_import_can_be_read_again(tmp_path: Path) -> None:
    """A limit below Vlowpu, a switched neutral, a grounded element and a strange voltage base survive the tables."""
    switch = "New Line.n phases=4 bus1=c.1.2.3.4 bus2=d.1.2.3.4 switch=yes"
    ground = "New Reactor.g phases=1 bus1=d.4 r=1 x=0\nNew Reactor.none phases=1 bus1=d.0 r=1 x=0"
    load = "New Load.l bus1=d.1.2.3.4 phases=3 kv=0.48 kw=90 vminpu=0.1"
    path = tmp_path / "Master.dss"
    path.write_text(
        f"{SOURCE}{LINE}{STEP_DOWN}{switch}\n{ground}\n{load}\nSet VoltageBases=(0.48)\nCalcVoltageBases\nSolve\n"
    )
    feeder = read_opendss(path)

    write_feeder(feeder, tmp_path / "tables")
    again = read_feeder(str(tmp_path / "tables"))

    assert [row.phases for row in again.switches] == ["ABC4"]
    assert "reactor.none" not in {row.name for row in again.elements}
    assert again.source is not None
    assert again.source.V_pu == pytest.approx(1.0)
    assert unlike(path) < TOLERANCE
