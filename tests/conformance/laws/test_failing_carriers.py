"""An FMU that fails is told in one line, harms no other process, and leaves nothing behind."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import pytest

from gridpeers.agents.agent_config import LawChoice
from gridpeers.agents.carriers.fmu import FmuLaw, fmu_problems
from gridpeers.agents.carriers.law_registry import close_laws
from gridpeers.agents.carriers.program import LEAVING, ProgramLaw
from gridpeers.agents.laws.call import LawError, decide, start_law
from gridpeers.agents.laws.law import Own

NAME = "FailingFmu.fmu"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("fmu")
    source = str(Path(__file__).parent / "failing_fmu.py")
    subprocess.run([sys.executable, "-m", "pythonfmu", "build", "-f", source, "-d", str(place)], check=True)
    return place


@pytest.fixture
def unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where FMUs are unpacked; it must be empty at the end."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    yield tmp_path
    assert not list(tmp_path.iterdir())


def steps(path: Path, how: float, time_limit: float = 10.0) -> float:
    choice = LawChoice(fmu=path.name, folder=str(path.parent), parameters={"how": how}, time_limit=time_limit)
    return two_steps(FmuLaw(choice))


def two_steps(law: FmuLaw | ProgramLaw) -> float:
    """P_set (pu) after two steps; the start has ten times the time, and of an FMU the first, as it is loaded before."""
    try:
        start_law(law, OWN)
        decide(law, OWN, (), 0.02)
        return decide(law, OWN, (), 0.02).P_set
    finally:
        law.close()


@pytest.mark.parametrize(("how", "said"), [
    (1, r"FailingFmu.fmu did not answer the step at t = 0 s within 1 s"),
    (2, r"step at t = 0 s returned P_set = nan; it must be a finite number \(pu\)"),
    (3, r"step at t = 0 s raised FMICallException: fmi2DoStep failed with status \d"),
    (4, r"FailingFmu.fmu ended at the step at t = 0 s with signal 6"),
])  # fmt: skip
def test_a_failing_step_of_an_fmu_is_reported(how: float, said: str, folder: Path, unpacked: Path) -> None:
    """The FMU hangs, returns nan, fails, or crashes its process."""
    with pytest.raises(LawError, match=said):
        steps(folder / NAME, how, time_limit=1.0 if how == 1 else 10.0)


def test_the_output_of_an_fmu_is_no_answer(folder: Path, unpacked: Path) -> None:
    """Its output goes to standard error; the decision stays the same."""
    assert steps(folder / NAME, 5) == 0.5


def test_an_fmu_that_cannot_be_loaded_is_reported(
    folder: Path, unpacked: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Its library is spoilt, or its file is cut short since the scenario was checked."""
    place = tmp_path_factory.mktemp("spoilt")
    with zipfile.ZipFile(folder / NAME) as whole, zipfile.ZipFile(place / NAME, "w") as other:
        for name in whole.namelist():
            other.writestr(name, whole.read(name)[:1000] if name.startswith("binaries/") else whole.read(name))
    with pytest.raises(LawError, match=r"ended at the start at t = 0 s with signal|OSError: "):
        steps(place / NAME, 0)
    (place / NAME).write_bytes((folder / NAME).read_bytes()[:-1000])
    with pytest.raises(LawError, match="BadZipFile"):
        steps(place / NAME, 0)

    assert re.match(f"{NAME} is no FMU: BadZipFile", fmu_problems(place / NAME, {})[0][1])


OWN = Own("inv1", True, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.01, 0.05, 6e5, 277.0, 60.0)

STAYS = "sleep 600 & sleep 600"  # A shell that ignores the end of its input, and has started another program

AGENT = f"""
import os, signal
from gridpeers.agents.carriers.program import ProgramLaw
from gridpeers.agents.agent_config import LawChoice
law = ProgramLaw(LawChoice(command=("sh", "-c", {STAYS!r})))
"""


@pytest.mark.parametrize("end", ["os.kill(os.getpid(), signal.SIGKILL)", "law.close()", "os._exit(1)"])
def test_nothing_outlives_an_agent_however_it_ends(end: str) -> None:
    """All processes hold one pipe, which ends with the last of them."""
    subprocess.run([sys.executable, "-c", AGENT + end], stderr=subprocess.PIPE, timeout=30.0)


def test_programs_that_ignore_the_end_of_their_input_are_waited_for_together() -> None:
    """All programs together have 1 s to end, not 1 s each."""
    laws = [ProgramLaw(LawChoice(command=("sh", "-c", STAYS))) for _ in range(8)]
    began = monotonic()

    close_laws(laws)

    assert LEAVING <= monotonic() - began < len(laws) * LEAVING


SHORT, ENDS, LONG = 0.05, 0.3, 6.0
"""Limits (s) of a program that never answers, of one that ends meanwhile, and of one that answers sooner or later."""

READY = 'echo \'{"type": "ready"}\'; read -r _'  # Answers the start, and takes the step


@pytest.mark.parametrize(("script", "limit", "said"), [
    ("printf '{\"type\":'; sleep 600", SHORT, r"did not answer the start at t = 0 s within 0.5 s"),
    ("while :; do echo too much >&2; done", SHORT, r"did not answer the start at t = 0 s within 0.5 s"),
    ("sleep 600 & exit 3", ENDS, r"ended at the start at t = 0 s with exit code 3"),
    ("head -c 200000 /dev/zero | tr '\\0' x; sleep 600", LONG, r"answered the start at .* with more than 100000 bytes"),
    (f"{READY}; echo hello; read -r _", LONG, r"answered the step at t = 0 s with 'hello'; answer e.g. "),
    (f"{READY}; echo '{{\"error\": \"no idea\"}}'; read -r _", LONG, r"says: no idea \(step at t = 0 s\)"),
    ("printf '{}\n{}\n'; read -r _", LONG, r"printed '.*' before the step at t = 0 s; print one line for each"),
    (f"{READY}; exit 7", LONG, r"ended at the step at t = 0 s with exit code 7"),
])  # fmt: skip
def test_a_program_with_a_wrong_answer_fails_with_one_line(script: str, limit: float, said: str) -> None:
    """Half a line, endless output, an early end with a child, a line without end, no JSON, an error, two lines."""
    choice = LawChoice(command=("sh", "-c", f"exec 2>/dev/null; read -r _; {script}"), time_limit=limit)
    with pytest.raises(LawError, match=said):
        two_steps(ProgramLaw(choice))


def test_a_closed_law_raises_an_error(tmp_path: Path) -> None:
    law = ProgramLaw(LawChoice(command=("cat",), folder=str(tmp_path)))
    law.close()
    law.close()

    with pytest.raises(LawError, match="cat ended before the start at t = 0 s"):
        law.start(OWN)
