"""`import gridpeers` is light, and brings every public name; rooms are imported below it alone."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import gridpeers as gp


def test_importing_gridpeers_loads_nothing_heavy() -> None:
    """The command line and every process start through this package: heavy modules are loaded on use."""
    heavy = {"numpy", "pandas", "jinja2", "scipy", "numba", "matplotlib", "msgspec", "rich", "zenoh"}
    code = f"import sys, gridpeers; print(sorted({heavy} & set(sys.modules)))"

    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert found.stdout == "[]\n"


def test_every_public_name_is_there_and_an_unknown_one_is_told_with_the_nearest() -> None:
    """Every name that `dir` lists can be imported, and `*` imports them."""
    assert all(getattr(gp, name) is not None for name in dir(gp))
    starred: dict[str, object] = {}
    exec("from gridpeers import *", starred)
    assert starred.keys() - {"__builtins__"} == {*dir(gp)} - {"__version__"}
    with pytest.raises(AttributeError, match='did you mean "load"'):
        _ = gp.lod  # type: ignore[attr-defined]


ROOMS = sorted(link.name for link in Path(gp.__file__).parent.iterdir() if link.is_symlink())


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_cannot_be_imported_by_the_name_of_its_folder(room: str) -> None:
    """The folder is found where the repository's root is on the path, as it is for the tests; its import is refused."""
    with pytest.raises(ImportError, match=f"import gridpeers.{room}"):
        import_module(room)
