"""Commands that are printed for people to type next."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gridpeers.wire.driver.command_line import command_line

TOLD = "import sys\nsys.path.insert(0, {root!r})\nsys.modules.pop('gridpeers', None)\n"
TOLD += "from gridpeers.wire.driver.command_line import command_line\n"
TOLD += "from pathlib import Path\nprint(command_line('run', 'a b'))\n"
TOLD += (
    "print(command_line('run', within=Path('study')))\nprint(command_line(program='pytest', within=Path('study')))\n"
)
ROOT = str(Path(__file__).parents[4])


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A folder with gridpeers and pytest in .venv/bin; the program prints the commands that it would."""
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    (programs / "gridpeers").write_text(f"#!{sys.executable}\n" + TOLD.format(root=ROOT))
    (programs / "pytest").write_text("")
    (programs / "gridpeers").chmod(0o755)
    (programs / "pytest").chmod(0o755)
    return tmp_path


def told(called: str, folder: Path, PATH: str = "/usr/bin:/bin") -> list[str]:
    """What the program prints when a shell is given this."""
    done = subprocess.run(
        called, shell=True, cwd=folder, env=os.environ | {"PATH": PATH}, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_a_program_called_by_a_relative_path_keeps_it_also_from_another_folder(clone: Path) -> None:
    """Without an active environment the bare name is not found: the path as typed is, and its way from elsewhere."""
    assert told(".venv/bin/gridpeers", clone) == [
        ".venv/bin/gridpeers run 'a b'",
        "../.venv/bin/gridpeers run",
        "../.venv/bin/pytest",
    ]
    assert told("./gridpeers", clone / ".venv" / "bin")[0] == "./gridpeers run 'a b'"


def test_a_program_called_by_its_name_has_its_name(clone: Path) -> None:
    """In an active environment nobody types a path, and another program of it is found, too."""
    active = f"{clone}/.venv/bin:/usr/bin:/bin"

    for called in ("gridpeers", ".venv/bin/gridpeers", f"{clone}/.venv/bin/gridpeers"):
        assert told(called, clone, active) == ["gridpeers run 'a b'", "gridpeers run", "pytest"]


def test_a_program_called_by_an_absolute_path_keeps_it(clone: Path) -> None:
    """It is found from everywhere."""
    program = f"{clone}/.venv/bin/gridpeers"

    assert told(program, clone)[:2] == [f"{program} run 'a b'", f"{program} run"]


def test_a_module_that_python_runs_is_run_so_again(clone: Path) -> None:
    """`python -m gridpeers` prints commands with the same python, as no program gridpeers need be there."""
    package = clone / "gridpeers"
    package.mkdir()
    (package / "__main__.py").write_text(TOLD.format(root=ROOT))
    (clone / ".venv" / "bin" / "python").symlink_to(sys.executable)

    assert told(".venv/bin/python -m gridpeers", clone) == [
        ".venv/bin/python -m gridpeers run 'a b'",
        "../.venv/bin/python -m gridpeers run",
        "../.venv/bin/python -m pytest",
    ]


def test_from_python_a_command_has_its_name() -> None:
    """In a notebook or a test nothing was typed."""
    assert command_line("down") == "gridpeers down"
