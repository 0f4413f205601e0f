"""Compiled functions, and where their machine code is kept."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.caching import CacheImpl
from numpy.typing import NDArray

from gridpeers.plant.build import build_plant
from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.kernel import compiled
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.loading import start_problem
from tests.side_by_side import compile_once

SOURCES = sorted(path for path in compiled.HERE.glob("*.py") if "\n@compiled\n" in path.read_text())


def fill(into: NDArray[Any], value: float) -> None:
    into[:] = value


def filled(dtype: type = float) -> tuple[list[Any], int]:
    """Return what a freshly declared function writes, and how often its code came from the disk."""
    function: Any = compiled.compiled(fill)
    into = np.zeros(2, dtype)
    function(into, 3.0)
    return into.tolist(), sum(function.stats.cache_hits.values())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for machine code, which has none yet."""
    monkeypatch.setattr(compiled, "FOLDER", tmp_path / "kernels")
    return tmp_path / "kernels"


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.name)
def test_an_edit_of_compiled_code_renames_its_cache(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever file with compiled code is edited, machine code of the text before is not loaded again."""
    folder = Path(shutil.copytree(source.parent, tmp_path / "dynamics", ignore=shutil.ignore_patterns("__pycache__")))
    monkeypatch.setattr(compiled, "HERE", folder)
    before = compiled.kernel_folder()

    with (folder / source.name).open("a") as file:
        file.write("\n")

    assert compiled.kernel_folder() != before


def test_an_edit_of_a_model_compiles_that_model_alone(tmp_path: Path) -> None:
    """The machine code of a model stands apart from the step, in a folder named by the files that its pass calls."""
    model = tmp_path / "mine.py"
    model.write_text("a")
    before = compiled.kernel_folder([str(model)])
    model.write_text("b")

    assert len({before, compiled.kernel_folder([str(model)]), compiled.kernel_folder()}) == 3


def test_another_process_loads_the_step_and_compiles_nothing() -> None:
    """A plant that has run on this machine starts in a second, where its compilation takes up to a minute."""
    compile_once()
    code = (
        "from gridpeers.plant.build import load_kernels; load_kernels()\n"
        "from gridpeers.plant.dynamics.kernel.step import run_steps\n"
        "print(*(sum(of.values()) for of in (run_steps.stats.cache_hits, run_steps.stats.cache_misses)))"
    )

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stdout == "1 0\n"


def test_code_for_other_types_is_not_taken(folder: Path) -> None:
    """Two processes may write code of two types into one file."""
    filled()
    (of_floats,) = folder.glob("*.1.nbc")
    filled(int)
    (of_integers,) = folder.glob("*.2.nbc")
    of_floats.replace(of_integers)

    assert filled(int) == ([3, 3], 0)


@pytest.mark.parametrize("place", ["none", "file"])
def test_without_a_folder_to_write_functions_run_and_nothing_is_kept(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No home, or a folder that cannot be made: the process compiles for itself, and numba seeks no other place."""
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setattr(compiled, "FOLDER", None if place == "none" else tmp_path / "file" / "kernels")
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])  # numba's places: a read-only installation has none of them

    assert filled() == ([3.0, 3.0], 0)
    assert not compiled.is_compiled("fill")


def test_machine_code_in_a_folder_that_is_read_alone_is_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An image whose builder left a warm cache starts without compiling; what it lacks is compiled and not kept."""
    filled()
    kept = sorted(folder.iterdir())
    monkeypatch.setattr(compiled.FunctionCache, "save_overload", refuse)

    assert filled() == ([3.0, 3.0], 1)
    assert filled(int) == ([3, 3], 0)
    assert sorted(folder.iterdir()) == kept
    assert compiled.is_compiled("fill")


def refuse(*_: object) -> None:
    raise PermissionError


def test_only_a_plant_that_takes_steps_compiles_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """`check` needs the operating point alone, which compiles in half of the time; a run's plant has its step too."""
    loaded = []
    monkeypatch.setattr(Dynamics, "run", lambda self, steps: loaded.append(steps))

    assert start_problem(*load_scenario("islanding")) == ""
    assert loaded == []

    build_plant(configs(*load_scenario("islanding"), "I")[0])
    assert loaded == [0]
