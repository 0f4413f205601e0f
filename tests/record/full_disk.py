"""Fill the disk under runs, and read what they leave behind: ``python -m tests.record.full_disk [KIND ...]``.

Every run writes into a small file system in memory, in a namespace of its own (``unshare``, Linux), and another file
fills it under way: down to a little room, which the run's other files get, or to none at all.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Literal, NamedTuple

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.record import PARTIAL
from tests.record.killed_commands import wait_for_rows
from tests.record.reader_commands import assert_commands_read

INSIDE = "inside"
"""Word that tells this program that it has a namespace of its own."""

OWN_NAMESPACE = ("unshare", "--user", "--map-root-user", "--mount")

SIZE = 64_000_000
"""Bytes of the file system."""

LITTLE = 1_500_000
"""Bytes that are left: less than a record leaves to others, and more than they take."""

ROWS = 60_000
"""Bytes of history from which on the disk is filled: about a second, so that there are decisions."""

CALM = """
[time]
end_s = 7.0
record_s = 0.02
[[event]]
label = "islanding"
t_s = 0.5
open = ["13-152"]
[case.calm]
secondary = "all"
graph = "full"
"""

ENDS = "the record run.mcap ends at "


class Kind(NamedTuple):
    """A run on a disk that is filled."""

    name: str
    words: tuple[str, ...]
    room: int
    """Bytes that are left."""
    status: Literal["complete: ", "broken: "]
    """Begin of its status at the end."""


def kinds() -> dict[str, Kind]:
    """Return the runs by name: each clock with a little room and with none, and a live one."""
    found = []
    for room, status in ((LITTLE, "complete: "), (0, "broken: ")):
        for clock in ("simulated", "wall"):
            words = ("run", "calm.toml", "--clock", clock)
            found.append(Kind(f"{clock}, {room / 1e6:g} MB left", words, room, status))  # type: ignore[arg-type]
    live = ("up", "calm.toml", "--run", "full", "--listen", free_endpoint(), "--for", "6")
    return {kind.name: kind for kind in (*found, Kind("live, 0 MB left", live, 0, "broken: "))}


def has_namespaces() -> bool:
    """Return whether this system lets one mount a file system in a namespace of one's own."""
    if shutil.which(OWN_NAMESPACE[0]) is None:
        return False
    words = [*OWN_NAMESPACE, "mount", "-t", "tmpfs", "none", tempfile.gettempdir()]
    return subprocess.run(words, capture_output=True, check=False).returncode == 0


def fill(folder: Path, room: int) -> None:
    """Write a file that takes all room of a disk but some, while the run takes of it too."""
    with (folder / "ballast").open("wb") as file:
        while (free := shutil.disk_usage(folder).free - room) > 0:
            with contextlib.suppress(OSError):  # the run was faster: what is free is looked up again
                os.posix_fallocate(file.fileno(), os.fstat(file.fileno()).st_size, free)


def filled(kind: Kind, disk: Path, kept: Path) -> str:
    """Run a case, fill its disk once there are rows, and check what is left; return a line on it."""
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "none", str(disk)], check=True)
    (disk / "calm.toml").write_text(CALM, encoding="utf-8")
    out = disk / "out"
    words = [sys.executable, "-m", "gridpeers", *kind.words, "--out", "out"]
    log = kept.with_suffix(".log")
    with log.open("wb") as printed:
        command = subprocess.Popen(words, cwd=disk, stdout=printed, stderr=subprocess.STDOUT)
        try:
            wait_for_rows(command, out / "calm" / PARTIAL, more=ROWS)
            fill(disk, kind.room)
            command.wait(120.0)
        finally:
            command.kill()
            command.wait()
    shutil.copytree(out, kept)
    return check(kind, kept, log.read_text(), command.returncode)


def check(kind: Kind, folder: Path, printed: str, code: int) -> str:
    """Assert that the run said what happened, that its folder is clean, and that the record can be read."""
    status = (folder / "status.txt").read_text()
    assert "Traceback" not in printed, printed
    assert status.startswith(kind.status), f"{status}\n{printed}"
    assert code == (0 if kind.status == "complete: " else 3), printed
    empty = [str(path) for path in folder.rglob("*") if path.is_file() and not path.stat().st_size]
    empty = [
        path for path in empty if not path.startswith(str(folder / "log"))
    ]  # of who had no word, or no room for it
    assert empty == [], f"{kind.name}: empty: {empty}"
    record = RunRecord.open(folder / "calm")
    assert not record.complete
    if kind.room:
        report = (folder / "report.txt").read_text()
        for text in (report, status, (folder / "log" / "run.log").read_text()):
            assert text.count(ENDS) == 1, text
        assert (folder / "calm" / "history.csv").exists()
    assert_commands_read(record)
    return f"{kind.name}: {status.strip()}; the record has {record.t_end:.2f} s and is read"


def main() -> None:
    """Run some kinds, all if none is named, in a namespace of its own."""
    if sys.argv[1:2] != [INSIDE]:
        words = [sys.executable, "-m", "tests.record.full_disk", INSIDE, *sys.argv[1:]]
        os.execvp(OWN_NAMESPACE[0], [*OWN_NAMESPACE, *words])
    known = kinds()
    with tempfile.TemporaryDirectory() as name:
        for number, kind in enumerate(known[each] for each in sys.argv[2:] or known):
            disk = Path(name) / f"disk{number}"
            try:
                print(filled(kind, disk, Path(name) / f"kept{number}"), flush=True)
            except RecordFileError as error:
                raise AssertionError(f"{kind.name}: {error}") from error
            finally:
                subprocess.run(["umount", "--lazy", str(disk)], check=False)


if __name__ == "__main__":
    main()
