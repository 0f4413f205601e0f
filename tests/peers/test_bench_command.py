"""The command `python -m bench.peers`: each part is kept once it is measured, and a failure is a line, no traceback."""

from pathlib import Path
from typing import NoReturn

import pytest

from bench.peers import __main__ as command
from bench.peers.measured import Measure
from bench.peers.parts import PARTS, SHORT, BenchPart, Extent
from bench.peers.publish import DOCS
from bench.peers.stored import DATA_FILE, read_parts, save_parts
from tests.peers.made_up import part_of


def fails(extent: Extent) -> NoReturn:
    """Fail before the first measure."""
    raise RuntimeError("no feeder")


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three parts that take no time: one is measured, one fails, one is interrupted."""

    def measured(extent: Extent) -> list[Measure]:
        return [Measure("ours", lambda: {"ours.tick.9": 0.002})]

    def interrupted(extent: Extent) -> NoReturn:
        raise KeyboardInterrupt

    for name, measures in (("tick", measured), ("plant", fails), ("links", interrupted)):
        monkeypatch.setitem(PARTS, name, BenchPart(measures, "made up", 1.0))


@pytest.mark.usefixtures("parts")
def test_a_part_that_fails_is_a_line_and_exit_code_1_and_the_others_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Part, measure and reason stand in one line; the page shows the same reason."""
    assert command.main(["plant", "tick", "--write", str(tmp_path)]) == 1

    told = capsys.readouterr()
    assert told.err.splitlines()[-1] == "plant: all of it: no feeder"
    assert "Traceback" not in told.err
    assert read_parts(tmp_path / DATA_FILE)["tick"].values == {"ours.tick.9": [0.002] * 5}
    assert "not measured: no feeder" in (tmp_path / "performance.md").read_text(encoding="utf-8")


@pytest.mark.usefixtures("parts")
def test_an_interrupted_bench_keeps_the_parts_that_are_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A quarter of an hour of measurements is not lost with the last part."""
    assert command.main(["tick", "links", "--write", str(tmp_path)]) == 130

    assert list(read_parts(tmp_path / DATA_FILE)) == ["tick"]
    assert "--resume" in capsys.readouterr().err


@pytest.mark.usefixtures("parts")
def test_a_part_that_is_measured_again_replaces_its_numbers_alone(tmp_path: Path) -> None:
    """Every part has its own date, load and versions."""
    save_parts({"plant": part_of(x=[1.0]), "tick": part_of(x=[2.0])}, tmp_path / DATA_FILE)

    command.main(["tick", "--write", str(tmp_path)])

    parts = read_parts(tmp_path / DATA_FILE)
    assert parts["plant"] == part_of(x=[1.0])
    assert parts["tick"].values == {"ours.tick.9": [0.002] * 5}
    assert parts["tick"].began != parts["plant"].began


@pytest.mark.usefixtures("parts")
def test_a_bench_that_is_resumed_measures_what_is_not_stored_of_this_commit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is stored of another commit, or failed, is measured again."""
    monkeypatch.setattr(command.machine_use, "commit", lambda: "abc")
    save_parts({"tick": part_of(x=[2.0])}, tmp_path / DATA_FILE)

    command.main(["plant", "tick", "--resume", "--write", str(tmp_path)])
    assert read_parts(tmp_path / DATA_FILE)["tick"].values == {"x": [2.0]}

    monkeypatch.setattr(command.machine_use, "commit", lambda: "def")
    command.main(["plant", "tick", "--resume", "--write", str(tmp_path)])
    assert read_parts(tmp_path / DATA_FILE)["tick"].values == {"ours.tick.9": [0.002] * 5}


@pytest.mark.usefixtures("parts")
def test_the_usual_times_are_told_before_the_start(capsys: pytest.CaptureFixture[str]) -> None:
    """A user knows how long it will take, and then which part of how many is measured."""
    command.main(["tick"])

    told = capsys.readouterr().err
    assert told.startswith("1 part, usually ")
    assert "tick (1 of 1" in told


def test_the_page_is_written_anew_without_measuring(tmp_path: Path) -> None:
    """Prose and figures change without a new run of the bench."""
    stored = (DOCS / DATA_FILE).read_bytes()
    (tmp_path / DATA_FILE).write_bytes(stored)

    assert command.main(["--page", str(tmp_path)]) == 0

    assert (tmp_path / DATA_FILE).read_bytes() == stored
    written = (tmp_path / "performance.md").read_text(encoding="utf-8")
    assert written == (DOCS / "performance.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["ticks"], 'part "ticks": there is no such part; choose from plant, case,'),
        (["--page", "docs", "tick"], "--page: goes with no part"),
        (["--resume"], "--resume: goes with --write DIR or --json FILE"),
    ],
)
def test_bad_usage_is_told_in_a_line(arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The line says what is wrong and what would be right."""
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)

    assert ended.value.code == 2
    assert told in capsys.readouterr().err


def test_a_file_that_has_no_measurements_is_left_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file of something else is not overwritten, and nothing is measured for it."""
    (tmp_path / DATA_FILE).write_text("[1]", encoding="utf-8")

    assert command.main(["tick", "--write", str(tmp_path)]) == 2

    assert "no measurements of this bench" in capsys.readouterr().err
    assert (tmp_path / DATA_FILE).read_text(encoding="utf-8") == "[1]"


@pytest.mark.parametrize("name", ["command", "links", "hosted", "scale"])
def test_a_part_measures_every_value_that_it_names(name: str) -> None:
    """The real measures, as short as can be: none fails, and each gives the values that rows of the page show."""
    measures = PARTS[name].measures(SHORT)

    for measure in measures:
        assert set(measure.values) <= set(measure.run())
