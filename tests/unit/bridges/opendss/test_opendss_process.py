"""The OpenDSS engine has a process of its own: what it does there ends no import without one line that says so."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest

from gridpeers.bridges.opendss.read_opendss import ENGINE, read_opendss
from gridpeers.plant.request_process import RequestProcess
from gridpeers.plant.tables.read import FeederError
from tests.command_line import invoke
from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN, write

CRASHING = """import os, signal
class DSSException(Exception):
    pass
class Anything:
    NumCircuits = 0
    def __init__(self):
        self.__dict__.update(Text=Text(), Error=Text())
class Text:
    def __setattr__(self, name, command):
        if "boom" in str(command):
            os.kill(os.getpid(), signal.SIGSEGV)
class DSS:
    NewContext = Anything
"""
"""An engine that crashes at a command with "boom"."""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A file that stands in the place of the package dss, in a process that begins and ends with the test."""
    ENGINE.close()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path / "dss.py"
    ENGINE.close()


def problem(path: Path) -> str:
    """The only problem of a script that the import refuses."""
    with pytest.raises(FeederError) as refused:
        read_opendss(path)
    (found,) = refused.value.problems
    assert "\n" not in found
    return found


def test_a_crash_of_the_engine_is_one_line(tmp_path: Path, package: Path) -> None:
    """It has file, line, command, signal, and what to do; the command ends with 2, and the next import works."""
    package.write_text(CRASHING)
    path = tmp_path / "Master.dss"
    path.write_text("Clear\nRedirect lines.dss\n")
    (tmp_path / "lines.dss").write_text("New Line.good\nNew Line.boom\n")

    assert problem(path).startswith(
        "lines.dss:2: the OpenDSS engine itself crashes (its process was killed by SIGSEGV)"
    )
    assert problem(path).endswith(": New Line.boom")
    code, text = invoke("feeder", "import", str(path))
    assert (code, text.count("\n")) == (2, 1)
    assert "lines.dss:2: the OpenDSS engine itself crashes" in text
    (tmp_path / "lines.dss").write_text("New Line.good\n")
    assert "makes no circuit" in problem(path)


@pytest.mark.parametrize(("damage", "reason"), [
    ("raise OSError('libdss.so: cannot open')", "(OSError: libdss.so: cannot open)"),
    ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "(its process was killed by SIGSEGV)"),
])  # fmt: skip
def test_a_damaged_wheel_is_one_line(tmp_path: Path, package: Path, damage: str, reason: str) -> None:
    """A package that is there and does not load is not missing: the line says why, and how to mend it."""
    package.write_text(damage + "\n")

    text = problem(write(tmp_path, LINE))

    assert text.startswith(f"dss is installed, but cannot be imported {reason}")
    assert text.endswith("pip install --force-reinstall dss-python dss-python-backend")


def engine() -> tuple[Path, Path]:
    """Files that tell whether the engine's process, and its folder, are there."""
    process = Path(f"/proc/{ENGINE._running[os.getpid()][0].pid}")  # noqa: SLF001
    return process, (process / "cwd").readlink()


def test_an_import_that_is_interrupted_leaves_no_process_and_no_wrong_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After an error while the engine reads, its process and folder are gone, and the next import is its own."""
    pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")
    read_opendss(write(tmp_path, LINE, STEP_DOWN))
    process, folder = engine()

    with monkeypatch.context() as interrupted, pytest.raises(KeyboardInterrupt):  # noqa: PT012
        interrupted.setattr(RequestProcess, "answer", Mock(side_effect=KeyboardInterrupt))
        read_opendss(write(tmp_path, LINE, STEP_DOWN))

    assert not folder.exists()
    assert not process.exists()
    assert len(read_opendss(write(tmp_path, LINE)).buses) == 3


def test_a_killed_engine_is_told_and_started_again(tmp_path: Path) -> None:
    """Whoever ends the engine's process ends one import at most."""
    pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")
    path = write(tmp_path, LINE)
    read_opendss(path)
    os.kill(int(engine()[0].name), signal.SIGKILL)

    with pytest.raises(FeederError, match="its process was killed by SIGKILL"):
        read_opendss(path)
    assert read_opendss(path).name == "test"
