"""`import gridpeers` is light, and says so when another package has taken one of our names."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import gridpeers as gp


def test_importing_gridpeers_loads_nothing_heavy() -> None:
    """The command line and every process start through this package: heavy modules are loaded on use."""
    heavy = {"numpy", "pandas", "jinja2", "scipy", "numba", "matplotlib", "msgspec", "rich", "zenoh"}
    code = f"import sys, gridpeers; print(sorted({heavy} & set(sys.modules)))"

    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert found.stdout == "[]\n"


def test_a_package_that_takes_one_of_our_names_is_told_in_one_line(tmp_path: Path) -> None:
    """Another "agents" before ours on the path ends the import, and the line says what to do."""
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents" / "__init__.py").touch()
    home = Path(gp.__file__).parents[1]
    code = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(home)!r}]; import gridpeers"

    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    last = found.stderr.splitlines()[-1]
    assert found.returncode == 1
    assert last.startswith(
        f'ImportError: gridpeers cannot be imported: Python finds another package "agents" in {tmp_path}'
    )
    assert "virtual environment" in last


def test_every_public_name_is_there_and_an_unknown_one_is_told_with_the_nearest() -> None:
    """Every name that `dir` lists can be imported."""
    assert all(getattr(gp, name) is not None for name in dir(gp))
    with pytest.raises(AttributeError, match='did you mean "load"'):
        _ = gp.lod  # type: ignore[attr-defined]
