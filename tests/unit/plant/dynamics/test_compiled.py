import resource
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.caching import CacheImpl
from numpy.typing import NDArray

from plant.build import build_plant
from plant.dynamics import Dynamics
from plant.dynamics.kernel import compiled, compiling
from plant.dynamics.kernel.compiled import Kernel
from plant.dynamics.kernel.machine_code import SUFFIX, MachineCode
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs
from scenarios.start_check import start_problem
from tests.side_by_side import compile_once

SOURCES = sorted(path for path in Path(compiled.__file__).parent.glob("*.py") if "\n@compiled\n" in path.read_text())


class Inner(NamedTuple):
    """A tuple in a tuple."""

    values: Any
    scale: float


class Outer(NamedTuple):
    """What a compiled function takes."""

    inner: Inner
    at: Any


def gather(outer: Any, sign: float, count: int) -> tuple[int, float, bool, complex]:
    """Sum picked values over a table of its own; everything that a compiled function of ours does and returns."""
    own = np.empty((count, 2))
    for i in range(count):
        for k in range(2):
            own[i, k] = sign * outer.inner.scale * outer.inner.values[outer.at[i], k]
    return count, own.sum(), own[0, 0] > 0.0, complex(own[0, 0], own[count - 1, 1])


def fill(into: NDArray[np.float64], value: float) -> None:
    """Return nothing."""
    into[:] = value


def spread(into: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    """Fail where the sizes differ."""
    into[:] = values


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
    monkeypatch.setattr(compiled, "_HERE", folder)
    before = compiled.kernel_folders()

    with (folder / source.name).open("a") as file:
        file.write("\n")

    assert not set(compiled.kernel_folders()) & set(before)


def test_machine_code_gives_what_the_function_gives(folder: Path) -> None:
    """Arrays in any order of memory, tuples in tuples, numbers; memory of its own; a result of several types."""
    values, at = np.arange(24.0).reshape(3, 8)[:, ::3].T, np.array([2, 0])
    for table in (values, np.ascontiguousarray(values)):
        outer = Outer(Inner(table, 2.0), at)
        expected = gather(outer, -1.0, 2)
        kernel = Kernel(gather)

        assert kernel(outer, -1.0, 2) == expected
        assert kernel(outer, -1.0, 2) == kernel.dispatcher(outer, -1.0, 2)
    assert len(list(folder.glob(f"*{SUFFIX}"))) == 2  # a type of array each


def test_what_is_written_into_an_array_stands_there(folder: Path) -> None:
    """A function that returns nothing still has its effect; one without room for what it writes fails."""
    table = np.zeros((3, 4))

    assert Kernel(fill)(table[1], 5.0) is None
    assert table.sum() == 20.0 == table[1].sum()
    with pytest.raises(RuntimeError, match="spread: the compiled function failed"):
        Kernel(spread)(table[0], np.zeros(3))


def test_another_process_reads_machine_code_without_numba() -> None:
    """A plant that has run on this machine starts without the compiler, whose import takes longer than a run."""
    compile_once()
    code = (
        "import sys; from plant.loaded_kernels import load_kernels; load_kernels()\n"
        "print(sorted({'numba', 'llvmlite'} & set(sys.modules)))"
    )

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stdout == "['llvmlite']\n"


def test_a_file_under_another_name_is_none(folder: Path) -> None:
    """Code of one function in the file of another would be called with what it cannot take, and end the process."""
    Kernel(fill)(np.zeros(2), 1.0)
    (file,) = folder.glob(f"*{SUFFIX}")

    other = file.rename(file.with_name(f"other{SUFFIX}"))

    assert MachineCode.read(other) is None


def test_what_cannot_be_kept_leaves_nothing(folder: Path) -> None:
    """A folder where its file should be: no part of a file stays beside it, however often that happens."""
    code = MachineCode("name", "f", b"code")
    (folder / f"fill{SUFFIX}").mkdir(parents=True)

    code.keep(folder / f"fill{SUFFIX}")

    assert [path.name for path in folder.iterdir()] == [f"fill{SUFFIX}"]


def test_a_damaged_file_is_compiled_anew(folder: Path) -> None:
    """Half a file, as of a full disk, is no machine code: linked, it would end the process."""
    Kernel(fill)(np.zeros(2), 1.0)
    (file,) = folder.glob(f"*{SUFFIX}")
    whole = file.read_bytes()
    assert MachineCode.read(file) is not None
    file.write_bytes(whole[: len(whole) // 2])
    assert MachineCode.read(file) is None

    into = np.zeros(2)
    Kernel(fill)(into, 3.0)

    assert into.tolist() == [3.0, 3.0]
    assert MachineCode.read(file) is not None


@pytest.mark.parametrize("place", ["none", "file"])
def test_without_a_folder_to_write_functions_run_and_nothing_is_kept(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No home, or a folder that cannot be made: the process compiles for itself, and numba seeks no other place."""
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setattr(compiled, "FOLDER", None if place == "none" else tmp_path / "file" / "kernels")
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])  # numba's places: a read-only installation has none of them
    into = np.zeros(2)

    Kernel(fill)(into, 3.0)

    assert into.tolist() == [3.0, 3.0]


def test_numba_keeps_nothing_where_its_cache_has_no_room(folder: Path) -> None:
    """A full home: numba would end the start with an error where it cannot write its own cache."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (compiling.ROOM // 2, hard))
    try:
        Kernel(fill)(np.zeros(2), 3.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    assert [path.suffix for path in folder.rglob("*")] == [SUFFIX]


def test_machine_code_in_a_folder_that_is_read_alone_is_used(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An image whose builder left a warm cache beside the sources starts without the compiler, and writes nothing."""
    Kernel(fill)(np.zeros(2), 1.0)
    monkeypatch.setattr(compiled, "FOLDER", None)
    monkeypatch.setattr(compiled, "BESIDE", folder)
    monkeypatch.setattr(compiling, "compile_call", None)
    into = np.zeros(2)

    Kernel(fill)(into, 3.0)

    assert into.tolist() == [3.0, 3.0]
    assert compiled.is_compiled("fill")


@pytest.mark.parametrize(
    ("system", "environment", "expected"),
    [
        ("linux", {"XDG_CACHE_HOME": "/cache", "HOME": "/home/me"}, "/cache/gridpeers"),
        ("linux", {"XDG_CACHE_HOME": "", "HOME": "/home/me"}, "/home/me/.cache/gridpeers"),
        ("darwin", {"HOME": "/Users/me"}, "/Users/me/Library/Caches/gridpeers"),
        ("linux", {"HOME": "me"}, None),
        ("linux", {"XDG_CACHE_HOME": "cache", "HOME": "/home/me"}, None),
    ],
)
def test_compiled_kernels_go_into_the_users_cache(
    system: str, environment: dict[str, str], expected: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each system has its own place for it; a relative path would be another folder in each working directory."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(compiled.sys, "platform", system)

    kept, _ = compiled.kernel_folders()

    assert (kept and str(kept.parent)) == expected


def test_a_user_without_a_home_has_no_cache_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user id that the system does not know, as containers have: nothing is kept."""

    def unknown() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", unknown)

    assert compiled.user_cache() is None


def test_where_machine_code_cannot_be_linked_numba_runs_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a system whose linker does not take it the function gives the same, and each start loads numba as before."""

    def refuse(*_: object, **__: object) -> None:
        raise RuntimeError("Symbols not found")

    monkeypatch.setattr(MachineCode, "linked", refuse)
    outer = Outer(Inner(np.arange(16.0).reshape(8, 2), 2.0), np.array([2, 0]))

    assert Kernel(gather)(outer, -1.0, 2) == gather(outer, -1.0, 2)


NO_MEMORY = """
import resource
from pathlib import Path
from plant.dynamics.kernel.machine_code import file_name
pages = int(Path("/proc/self/statm").read_text().split()[0])
room = pages * resource.getpagesize() + 2**24
resource.setrlimit(resource.RLIMIT_AS, (room, room))
try:
    file_name("step", "")
except OSError as error:
    print(error)
"""


def test_llvmlite_without_memory_is_told_as_such() -> None:
    """Llvmlite says that its library could not be found or loaded; a campaign would take that for the scenario's."""
    done = subprocess.run([sys.executable, "-c", NO_MEMORY], capture_output=True, text=True, timeout=60.0)

    assert (done.stdout, done.stderr) == ("[Errno 12] Cannot allocate memory: 'libllvmlite.so'\n", "")


def test_a_record_by_itself_goes_to_numba(folder: Path) -> None:
    """What has no words here is called as before."""
    record = np.zeros(1, [("a", "f8"), ("b", "f8")])[0]
    record["a"] = 2.0

    assert Kernel(take_a)(record, 3.0) == 6.0
    assert not folder.exists() or not list(folder.glob(f"*{SUFFIX}"))


def take_a(record: Any, factor: float) -> float:
    """Read a field."""
    return float(record.a * factor)


def test_only_a_plant_that_takes_steps_compiles_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """`check` needs the operating point alone, which compiles in half of the time; a run's plant has its step too."""
    loaded = []
    monkeypatch.setattr(Dynamics, "run", lambda self, steps: loaded.append(steps))

    assert start_problem(*load_scenario("islanding")) == ""
    assert loaded == []

    build_plant(configs(*load_scenario("islanding"), "I")[0])
    assert loaded == [0]
