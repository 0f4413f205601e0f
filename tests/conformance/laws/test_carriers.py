"""One law, four carriers, two drivers: the same history to the byte."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import gridpeers as gp
from tests.conformance.laws.consensus_fmi3 import NAME, build, described
from tests.conformance.laws.law_runs import SHORT, islanding, written

HERE = Path(__file__).parent
PATIENT = {"time_limit_s": 30.0}  # A busy machine is no reason to fail


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("fmu")
    source = str(HERE / "consensus_fmu.py")
    subprocess.run([sys.executable, "-m", "pythonfmu", "build", "-f", source, "-d", str(folder)], check=True)
    return {"fmu": "ConsensusFmu.fmu", "folder": str(folder)}


@pytest.fixture(scope="module")
def fmi3(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    cc = shutil.which("cc")
    if cc is None:
        pytest.skip("no C compiler is here")
    folder = tmp_path_factory.mktemp("fmi3")
    return {"fmu": build(cc, folder), "folder": str(folder)}


def test_a_foreign_class_gives_the_history_of_the_built_in_law() -> None:
    """Processes run a class in tests/unit/gridpeers/test_own_law.py, and a program in test_law_programs.py."""
    assert written("gridpeers.agents.laws.consensus:Consensus").sha256 == islanding(short=True).sha256


def test_an_fmu_gives_the_history_of_the_class_and_has_the_parameters_that_it_declares(fmu: dict[str, str]) -> None:
    """With both drivers. The scenario sets its parameters; an unknown one is a problem."""
    k_p = {"gains.k_p": 0.0014}
    slower = written({**fmu, **PATIENT, "k_p": 0.0014})

    assert written(fmu | PATIENT, driver="processes").sha256 == islanding(short=True).sha256
    assert slower.sha256 == gp.load("islanding").replace(k_p | SHORT).run("IV").sha256
    with pytest.raises(gp.ScenarioError, match=re.escape('case.IV.law.k_pp: unknown parameter; did you mean "k_p"?')):
        written({**fmu, "k_pp": 1.0})


def test_an_fmu_for_another_platform_is_refused_by_name(fmu: dict[str, str], tmp_path: Path) -> None:
    """One line names the platform of the FMU, before the run."""
    with zipfile.ZipFile(Path(fmu["folder"]) / fmu["fmu"]) as whole, zipfile.ZipFile(tmp_path / "x.fmu", "w") as other:
        for name in whole.namelist():
            if not name.startswith("binaries/") or "win64" in name:
                other.writestr(name, whole.read(name))
        if not any("win64" in name for name in whole.namelist()):
            other.writestr("binaries/win64/ConsensusFmu.dll", b"MZ")

    with pytest.raises(gp.ScenarioError, match=r"case.IV.law.fmu: x.fmu is for .*win64.*, and this is "):
        written({"fmu": "x.fmu", "folder": str(tmp_path)})


def test_an_fmu_of_fmi_3_gives_the_history_of_the_class(fmi3: dict[str, str]) -> None:
    """Also with a parameter, and after a reset by a second grid connection."""
    k_p = {"gains.k_p": 0.0014}
    twice = [("event1", 1.0, "open"), ("back", 1.2, "close"), ("event2", 1.4, "open")]
    events = [{"label": label, "t_s": t, action: ["13-152"]} for label, t, action in twice]
    scenario = gp.load("islanding").replace({**SHORT, "time.end_s": 1.8, "event": events})

    carried = scenario.replace({"case.IV.law": {**fmi3, **PATIENT, "k_p": 0.0014}}).run("IV")
    assert carried.sha256 == scenario.replace(k_p).run("IV").sha256


def test_an_fmu_that_cannot_be_a_law_is_reported_before_the_run(tmp_path: Path) -> None:
    """A variable of another type: one line at its key, and no traceback."""
    fmpy, here = pytest.importorskip("fmpy"), Path.cwd()
    with zipfile.ZipFile(tmp_path / f"{NAME}.fmu", "w") as packed:
        packed.writestr("modelDescription.xml", described("Boolean"))
        packed.writestr(f"binaries/{fmpy.platform_tuple}/{NAME}{fmpy.sharedLibraryExtension}", b"")

    said = f"case.IV.law.fmu: {NAME}.fmu has own_leader as Boolean; declare it as a scalar Float64"
    with pytest.raises(gp.ScenarioError, match=re.escape(said)):
        written({"fmu": f"{NAME}.fmu", "folder": str(tmp_path)})
    assert Path.cwd() == here
