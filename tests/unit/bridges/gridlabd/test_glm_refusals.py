"""What cannot be imported from a model is refused by name, several mistakes at once, each in one line."""

import re
import sys
from pathlib import Path

import pytest

from gridpeers.bridges.gridlabd.read_glm import read_glm
from gridpeers.plant.tables.read import FeederError
from tests.unit.bridges.gridlabd.glm_models import CENTRE_TAP, HEAD, LOADS, write

pytest.importorskip("gridlabd", reason="the import of .glm files needs the extra gridlabd")

LOAD = "object load { name l1; phases ABCN; parent b; nominal_voltage 7200; constant_power_A 1e4; }\n"
LINE = "object overhead_line { name NAME; phases ABCN; from FROM; to TO; length LENGTH; configuration uneven; }\n"
NODE = "object node { name NAME; phases ABCN; nominal_voltage 7200; }\n"


def line(name: str, start: str, end: str, length: str = "100") -> str:
    words = {"NAME": name, "FROM": start, "TO": end, "LENGTH": length}
    text = LINE
    for key, value in words.items():
        text = text.replace(key, value)
    return text


def problems(path: Path, **options: list[str]) -> tuple[str, ...]:
    """Problems of a model that the import refuses."""
    with pytest.raises(FeederError) as refused:
        read_glm(path, **options)
    assert all("\n" not in problem for problem in refused.value.problems)
    return refused.value.problems


ONE_LINE = {
    "no module": ("object node { name a; }\n", "feeder.glm:1: class 'node' is not known"),
    "nothing of a feeder": ("module tape;\n", "feeder.glm: does not load GridLAB-D's module powerflow"),
    "an include that is not there": (HEAD + '#include "gone.glm"\n', "feeder.glm:9: #include failed"),
    "a program": (HEAD + "#system rm -rf nothing\n", "feeder.glm:9: #system would run or load a program"),
    "no substation": (HEAD.replace("bustype SWING;", ""), "NR: no swing bus found"),
    "two substations": (
        HEAD + NODE.replace("NAME", "s2").replace("phases", "bustype SWING; phases") + line("l2", "b", "s2"),
        "feeder.glm:9: node.s2: a second source; make its bustype PQ",
    ),
    "a substation of one phase": (
        HEAD.split("object line_configuration")[0].replace("ABCN", "AN")
        + "object load { name l1; phases AN; parent sub; nominal_voltage 7200; constant_power_A 1e4; }\n",
        "node.sub: a source needs phases A, B and C",
    ),
    "a house": (
        "module residential { implicit_enduses NONE; }\n"
        + HEAD
        + CENTRE_TAP
        + "object house { name h1; parent tm; }\n",
        "feeder.glm:24: house.h1: class house has no counterpart in gridpeers; leave it out (--leave-out house.h1)",
    ),
    "an inverter": (
        "module generators;\n"
        + HEAD
        + "object inverter_dyn { name i1; parent b; control_mode GRID_FORMING; rated_power 1e5; Pref 1e4; }\n",
        "feeder.glm:10: inverter_dyn.i1: class inverter_dyn has no counterpart in gridpeers; leave it out",
    ),
    "an open line": (
        HEAD
        + NODE.replace("NAME", "d")
        + line("l2", "b", "d")
        + line("l3", "b", "d").replace("phases", "status OPEN; phases"),
        "feeder.glm:11: overhead_line.l3: has status OPEN; leave it out",
    ),
    "a line of no length": (HEAD + NODE.replace("NAME", "d") + line("l2", "b", "d", "0"), "zero length"),
    "no nominal voltage": (
        HEAD.replace("7200", "nan"),
        "feeder.glm:8: node.b: nominal_voltage must be above 0 V, got nan V",
    ),
    "voltages that are no numbers": (
        HEAD.replace("voltage_A 7300", "voltage_A nan") + LOAD,
        "feeder.glm:3: node.sub: GridLAB-D found no solution: it has no voltage in phase A, nor at 3 more nodes",
    ),
    "no solution": (HEAD + LOAD.replace("1e4", "1e9"), "convergence iteration limit reached"),
}


OF_THE_WHOLE = ("nothing of a feeder", "no substation", "no solution")  # problems that no line of a model has


@pytest.mark.parametrize("what", ONE_LINE)
def test_one_line_says_what_is_refused(tmp_path: Path, what: str) -> None:
    """Each thing that cannot be represented is named, and nothing is written."""
    model, told = ONE_LINE[what]

    said = problems(write(tmp_path, model))

    assert any(told in text for text in said)
    assert re.match(r"\w+\.glm:\d+: ", said[0]) or what in OF_THE_WHOLE
    assert [path.name for path in tmp_path.iterdir()] == ["feeder.glm"]


def test_floating_sections_are_left_out(tmp_path: Path) -> None:
    """A section without a source is one note, with its first bus; if it has most of the load, it is a problem."""
    model = HEAD + LOAD + NODE.replace("NAME", "d1") + NODE.replace("NAME", "d2") + line("l2", "d1", "d2")

    feeder = read_glm(write(tmp_path, model))

    assert {bus.name for bus in feeder.buses} == {"sub", "b"}
    assert any("d1, d2 (first d1.A, d1.B, d1.C): no path to the source; left out" in note for note in feeder.notes)
    heavy = LOAD.replace("l1", "heavy").replace("parent b", "parent d1").replace("power_A 1e4", "impedance_A 50+0j")
    assert any("d1" in problem for problem in problems(write(tmp_path, model + heavy)))


def test_all_that_is_not_supported_comes_at_once(tmp_path: Path) -> None:
    """Unsupported objects, wrong patterns, switches and frequency are told together; what is left out is no problem."""
    model = "module tape;\n" + LOADS + "object player { name p1; parent wye; property constant_power_A; file p.csv; }\n"
    (tmp_path / "p.csv").write_text("2000-01-01 00:00:00,9e4+1e4j\n")
    path = write(tmp_path, model)

    with pytest.raises(FeederError) as refused:
        read_glm(path, f_nom=50.0, leave_out=["house.*"], switches=["nothere"])

    said = refused.value.problems
    assert len(said) == 4
    assert any("player.p1: class player has no counterpart in gridpeers; leave it out" in problem for problem in said)
    feeder = read_glm(path, leave_out=["player.*", "load.delta"])
    assert {part.S for part in feeder.load_parts if part.name == "load.wye"} >= {9e4 + 1e4j}
    assert all(part.name != "load.delta" for part in feeder.load_parts)


PLAYER = (
    "module tape;\n" + HEAD + LOAD + "object player { name p1; parent l1; property constant_power_A; file p.csv; }\n"
)


@pytest.mark.parametrize(("model", "leave_out"), [(HEAD + LOAD, []), (PLAYER, ["player.*"])], ids=["all", "no player"])
def test_voltages_that_are_not_gridlabds_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str, leave_out: list[str]
) -> None:
    """A model is refused where our power flow differs by more than the limit, also without its players."""
    (tmp_path / "p.csv").write_text("2000-01-01 00:00:00,9e3+1e3j\n")
    monkeypatch.setattr("gridpeers.bridges.feeder_import.MATCH", 0.0)

    (problem,) = problems(write(tmp_path, model), leave_out=leave_out)

    assert re.match(r"feeder\.glm:\d+: bus (sub|b): our power flow differs from GridLAB-D's by ", problem)


def test_a_load_to_which_gridlabd_adds_what_is_left_out_is_told(tmp_path: Path) -> None:
    """Of a load with an inverter that is left out nobody can tell what is its own: a note says that it is gone."""
    inverter = "object inverter_dyn { name i1; parent l1; control_mode GRID_FORMING; rated_power 1e5; Pref 1e4; }\n"
    other = "object load { name l2; phases ABCN; parent b; nominal_voltage 7200; constant_power_B 2e4; }\n"

    feeder = read_glm(write(tmp_path, "module generators;\n" + HEAD + LOAD + other + inverter), leave_out=["inv*.*"])

    assert [part.name for part in feeder.load_parts] == ["load.l2"]
    assert any(note.startswith("load.l1: its own load is not taken over") for note in feeder.notes)


def test_what_gridlabd_would_write_is_not_written(tmp_path: Path) -> None:
    """Recorders and dumps of a model leave nothing in its folder, and assertions do not end it."""
    write(
        tmp_path,
        "module tape;\nmodule assert;\n"
        + HEAD
        + LOAD
        + "object recorder { name r1; parent b; property voltage_A; file out.csv; interval 1; }\n"
        + "object voltdump { filename volts.csv; }\n"
        + "object double_assert { parent b; target nominal_voltage; value 1; within 0.1; }\n",
    )

    feeder = read_glm(tmp_path / "feeder.glm")

    assert len(feeder.load_parts) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["feeder.glm"]


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8-sig", "utf-16"])
def test_a_model_in_another_encoding_is_refused(tmp_path: Path, encoding: str) -> None:
    """GridLAB-D reads UTF-8 alone: an included file in another encoding is named, with what to do."""
    (tmp_path / "load 1.glm").write_text(LOAD.replace("l1", "l\u00e4"), encoding=encoding)

    (problem,) = problems(write(tmp_path, HEAD + '#include "load 1.glm"\n'))

    assert problem == "load 1.glm: is not in UTF-8, or begins with a byte order mark; save it as UTF-8"


def test_a_missing_wheel_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without GridLAB-D one line says what to install."""
    monkeypatch.setitem(sys.modules, "gridlabd", None)

    assert problems(write(tmp_path, HEAD + LOAD)) == (
        "reading .glm files needs GridLAB-D; install it: pip install -e '.[gridlabd]'",
    )
