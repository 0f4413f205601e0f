"""Where a run's results go, and that nothing there is overwritten."""

import errno
import os
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

import pytest

from gridpeers.scenarios.results import run_files
from gridpeers.scenarios.results.run_files import (
    FolderError,
    TerminatedError,
    broken_if_ended,
    new_folder,
    set_broken,
    set_status,
    write_whole,
)
from gridpeers.scenarios.run import run
from gridpeers.scenarios.run_request import BrokenRunError, Request
from gridpeers.scenarios.schema import load_scenario
from gridpeers.wire.driver.ending import READER_GONE, OutputLostError
from tests.scenario_files import written

NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


def test_runs_get_folders_by_time_and_latest_is_the_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    first, second = new_folder(None, "islanding", NOW), new_folder(None, "islanding", NOW)

    assert first == Path("runs/islanding/2026-01-02T03-04-05")
    assert second == Path("runs/islanding/2026-01-02T03-04-05-2")
    assert Path("runs/islanding/latest").resolve() == second.resolve()


def test_a_folder_with_something_in_it_is_refused_and_left_alone(tmp_path: Path) -> None:
    """Old results are never overwritten."""
    (tmp_path / "mine.txt").write_text("mine")

    with pytest.raises(FolderError, match="the folder is not empty; give a new or an empty one"):
        new_folder(tmp_path, "islanding", NOW)

    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_of_two_commands_at_once_one_gets_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other one has seen it empty, too, and is refused before it writes anything."""
    monkeypatch.setattr(run_files, "_require_empty", lambda *words: None)
    new_folder(tmp_path, "islanding", NOW)
    set_status(tmp_path, "complete")

    with pytest.raises(FolderError, match="the folder is not empty; give a new or an empty one"):
        new_folder(tmp_path, "islanding", NOW)

    assert (tmp_path / "status.txt").read_text() == "complete\n"


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    """A file in the place of the folder is told, also as a parent."""
    (tmp_path / "file").write_text("")

    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(FolderError, match=r"this is a file|cannot be made or written: Not a directory"):
            new_folder(out, "islanding", NOW)


def test_a_full_disk_leaves_no_part_of_a_file_and_the_status_still_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no new file can be made, the reason is written into the room that status.txt has; it may be longer."""
    set_status(tmp_path, "running")

    opened = Path.open

    def full(path: Path, mode: str = "r", **options: Any) -> IO[Any]:
        if "w" not in mode:
            return opened(path, mode, **options)
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(OSError, match="No space left"):
        write_whole(tmp_path / "metrics.json", "{}")
    set_broken(tmp_path, "cannot be\nwritten")

    assert [path.name for path in tmp_path.iterdir()] == ["status.txt"]
    assert (tmp_path / "status.txt").read_text() == "broken: cannot be written\n"


def test_a_text_that_names_a_folder_of_any_bytes_is_utf_8(tmp_path: Path) -> None:
    """Bytes of a name that are no UTF-8 are escapes in what is written, whether the file is new or there."""
    place = os.fsdecode(b"runs\xff")

    write_whole(tmp_path / "report.txt", f"Results: {place}/")
    set_broken(tmp_path, f"{place} is gone")

    assert (tmp_path / "report.txt").read_text(encoding="utf-8") == "Results: runs\\udcff/"
    assert (tmp_path / "status.txt").read_text(encoding="utf-8") == "broken: runs\\udcff is gone\n"


@pytest.mark.parametrize(("error", "told"), [
    (KeyboardInterrupt(), "interrupted from the keyboard"),
    (TerminatedError(), "interrupted by SIGTERM"),
    (ValueError("two\nlines"), "two lines"),
    (ZeroDivisionError(), "ZeroDivisionError"),
    (OSError(errno.ENOSPC, "No space left on device", "out/history.csv"), "out/history.csv: cannot be written: "),
    (OutputLostError(READER_GONE, "nobody reads its output any more"), "nobody reads its output any more"),
])  # fmt: skip
def test_the_status_says_why_a_run_ended_early(error: BaseException, told: str, tmp_path: Path) -> None:
    """In one line; the error goes on to whoever has asked for the run."""
    with pytest.raises(type(error)), broken_if_ended(tmp_path):
        raise error

    assert (tmp_path / "status.txt").read_text().startswith(f"broken: {told}")


SHORT = '[time]\nend_s = 0.1\n[case.calm]\nsecondary = "all"\ngraph = "ring"\n'


def test_a_run_whose_folder_is_removed_says_so(tmp_path: Path) -> None:
    """It names what it could not write, and no log that is gone as well."""
    scenario, feeder = load_scenario(written(tmp_path, SHORT))
    folder = tmp_path / "lab"
    folder.mkdir()

    def remove(case: str, t: float, end: float) -> None:
        if t > 0.0:
            shutil.rmtree(folder, ignore_errors=True)

    request = Request(scenario=scenario, feeder=feeder, driver="inprocess", folder=folder)
    with pytest.raises(BrokenRunError) as caught:
        run(request, remove)

    assert str(caught.value).endswith("cannot be written: No such file or directory")
    assert str(folder) in str(caught.value)
