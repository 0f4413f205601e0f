"""The wheel in an environment of its own, beside a distribution that has packages of our rooms' names.

What the wheel depends on comes from the environment of the tests, as a folder on the path.
"""

from __future__ import annotations

import re
import subprocess
import sys
import venv
from importlib.metadata import Distribution
from pathlib import Path
from typing import NamedTuple
from zipfile import ZipFile

import pytest

import gridpeers as gp
from tests.golden.catalogue.pins import ran

HOME = Path(gp.__file__).parent
NEIGHBOUR = "openai-agents"  # A distribution with a package `agents`

PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")


class Wheels(NamedTuple):
    """Files of the wheels."""

    gridpeers: Path
    neighbour: Path


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> Wheels:
    """Build our wheel, and fetch the neighbour's."""
    folder = tmp_path_factory.mktemp("wheels")
    constraints = HOME.parent / "constraints.txt"
    words = ["download", "--no-deps", "--dest", folder, "--constraint", constraints, NEIGHBOUR]
    fetching = subprocess.Popen([*PIP, *words], stderr=subprocess.PIPE, text=True)
    subprocess.run([*PIP, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, HOME.parent], check=True)
    _, why = fetching.communicate()
    if fetching.returncode:
        pytest.skip(f"no package index gives {NEIGHBOUR}: {why.strip().splitlines()[-1]}")
    (ours,), (theirs,) = folder.glob("gridpeers-*.whl"), folder.glob("openai_agents-*.whl")
    return Wheels(ours, theirs)


def test_the_wheel_runs_beside_a_distribution_with_our_rooms_names(wheels: Wheels, tmp_path: Path) -> None:
    """The two have no file in common: neither overwrites the other, or takes it away; a run has the same bytes."""
    venv.create(tmp_path / "venv", symlinks=True)
    python = tmp_path / "venv" / "bin" / "python"
    (packages,) = (tmp_path / "venv").glob("lib/python*/site-packages")
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "scenarios").mkdir(parents=True)
    (elsewhere / "scenarios" / "__init__.py").write_text("raise ImportError('a user has a package scenarios')")

    def install(wheel: Path) -> set[str]:
        """Install one wheel, and return the files of its distribution."""
        words = ["--python", python, "install", "--no-deps", "--no-index", "--no-compile"]
        subprocess.run([*PIP, *words, "--force-reinstall", wheel], check=True)
        (found,) = packages.glob(f"{wheel.name.partition('-')[0]}-*.dist-info")
        return {str(file) for file in Distribution.at(found).files or () if not str(file).startswith("..")}

    theirs, ours = install(wheels.neighbour), install(wheels.gridpeers)
    of_tests = [folder for folder in sys.path if folder.endswith("site-packages")]
    (packages / "dependencies.pth").write_text("\n".join(of_tests))  # behind what is installed here
    assert ours & theirs == set()
    assert any(file.startswith("agents/") for file in theirs)
    assert {file.partition("/")[0].partition("-")[0] for file in ours} == {"gridpeers"}

    words = ["-m", "gridpeers", "run", "islanding", "--case", "IV", "--out", "out"]
    done = subprocess.run([python, *words], cwd=elsewhere, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    recorded, _ = ran("islanding", "IV")
    result = gp.read(elsewhere / "out")
    assert isinstance(result, gp.Result)
    assert result.sha256 == recorded.sha256

    def uninstall(name: str) -> None:
        subprocess.run([*PIP, "--python", python, "uninstall", "--yes", name], check=True)

    uninstall("gridpeers")
    assert all((packages / file).exists() for file in theirs)
    install(wheels.gridpeers)
    install(wheels.neighbour)
    uninstall(NEIGHBOUR)
    code = "import gridpeers as gp; assert gp.load('islanding').cases; assert gp.Law"
    subprocess.run([python, "-c", code], cwd=elsewhere, check=True)
    words = [python, "-m", "gridpeers", "--version"]
    told = subprocess.run(words, cwd=elsewhere, capture_output=True, text=True, check=True)
    assert re.search(r" \([0-9a-f]{7,}\+?\)$", told.stdout), "the wheel has the commit that it was built from"


def test_the_wheel_has_every_file_of_every_room(wheels: Wheels, tmp_path: Path) -> None:
    """Also of those that are linked, the mark that its types can be checked, and the pages if they are built."""
    with ZipFile(wheels.gridpeers) as archive:
        names = {name for name in archive.namelist() if name.startswith("gridpeers/")}
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(words, cwd=HOME.parent, capture_output=True, text=True, check=True)
    rooms = {link.name for link in HOME.iterdir() if link.is_symlink()}
    expected = {
        name if name.startswith("gridpeers/") else f"gridpeers/{name}"
        for name in listed.stdout.splitlines()
        if name.partition("/")[0] in rooms | {"gridpeers"} and not (HOME.parent / name).is_symlink()
    }

    site = HOME / "viewer" / "site"
    expected |= {str(file.relative_to(HOME.parent)) for file in site.rglob("*") if file.is_file()}

    assert names == expected | {"gridpeers/commit.txt"}
    assert "gridpeers/py.typed" in names
