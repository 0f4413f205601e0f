"""Fill the disk under runs, and read what they leave behind: ``python -m tests.record.full_disk [KIND ...]``.

Every run writes into a small file system in memory, in a namespace of its own (``unshare``, Linux), and another file
fills it under way.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.record.record_reader import RunRecord
from tests.record.killed_commands import wait_for_rows
from tests.record.reader_commands import assert_commands_read

INSIDE = "inside"
"""Word that tells this program that it has a namespace of its own."""

OWN_NAMESPACE = ("unshare", "--user", "--map-root-user", "--mount")

SIZE = 64_000_000
"""Bytes of the file system."""

BEGUN = 1.0
"""Run time (s) of the record from which on the disk is filled, so that there are decisions."""

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
without_agent = ["inv3", "inv5", "inv6", "inv8", "inv9"]
"""


def kinds() -> dict[str, tuple[str, ...]]:
    """Return the words of each run, by name."""
    return {
        "simulated": ("run", "calm.toml", "--clock", "simulated"),
        "live": ("up", "calm.toml", "--run", "full", "--listen", free_endpoint(), "--for", "4"),
    }


def has_namespaces() -> bool:
    """Return whether this system lets one mount a file system in a namespace of one's own."""
    if shutil.which(OWN_NAMESPACE[0]) is None:
        return False
    words = [*OWN_NAMESPACE, "mount", "-t", "tmpfs", "none", tempfile.gettempdir()]
    return subprocess.run(words, capture_output=True, check=False).returncode == 0


def fill(folder: Path) -> None:
    """Write a file that takes all room of a disk, while the run takes of it too."""
    with (folder / "ballast").open("wb") as file:
        while free := shutil.disk_usage(folder).free:
            with contextlib.suppress(OSError):  # the run was faster: what is free is looked up again
                os.posix_fallocate(file.fileno(), os.fstat(file.fileno()).st_size, free)


def filled(kind: str, words: tuple[str, ...], disk: Path, kept: Path) -> str:
    """Run a case, fill its disk once there are rows, and check what is left; return a line on it."""
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "none", str(disk)], check=True)
    text = CALM.replace("end_s = 7.0", "end_s = 60.0")  # simulated time is fast: its record is to be under way still
    (disk / "calm.toml").write_text(text, encoding="utf-8")
    out = disk / "out"
    log = kept.with_suffix(".log")
    with log.open("wb") as printed:
        command = subprocess.Popen(
            [sys.executable, "-m", "gridpeers", *words, "--out", "out"], cwd=disk, stdout=printed, stderr=printed
        )
        try:
            wait_for_rows(command, out / "calm" / FILE, lambda t: t > BEGUN)
            fill(disk)
            command.wait(120.0)
        finally:
            command.kill()
            command.wait()
    shutil.copytree(out, kept)
    return check(kind, kept, log.read_text(), command.returncode)


def check(kind: str, folder: Path, printed: str, code: int) -> str:
    """Assert that the run said what happened, that its folder is clean, and that the record can be read."""
    status = (folder / "status.txt").read_text()
    assert "Traceback" not in printed, printed
    assert status.startswith("broken: "), f"{status}\n{printed}"
    assert code == 3, printed
    written = [path for path in folder.rglob("*") if path.is_file() and "log" not in path.relative_to(folder).parts]
    empty = [
        path for path in written if not path.stat().st_size
    ]  # who had no word, or no room for it, has an empty log
    assert empty == [], f"{kind}: empty: {empty}"
    record = RunRecord.open(folder / "calm")
    assert not record.complete
    assert_commands_read(record)
    return f"{kind}: {status.strip()}; the record has {record.t_end:.2f} s and is read"


def main() -> None:
    """Run some kinds, all if none is named, in a namespace of its own."""
    if sys.argv[1:2] != [INSIDE]:
        words = [sys.executable, "-m", "tests.record.full_disk", INSIDE, *sys.argv[1:]]
        os.execvp(OWN_NAMESPACE[0], [*OWN_NAMESPACE, *words])
    known = kinds()
    with tempfile.TemporaryDirectory() as name:
        for kind in sys.argv[2:] or known:
            disk = Path(name) / kind
            try:
                print(filled(kind, known[kind], disk, Path(name) / f"{kind}-kept"), flush=True)
            except RecordFileError as error:
                raise AssertionError(f"{kind}: {error}") from error
            finally:
                subprocess.run(["umount", "--lazy", str(disk)], check=False)


if __name__ == "__main__":
    main()
