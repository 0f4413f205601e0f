"""One law, four carriers, two drivers: the same history to the byte."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import pytest

import gridpeers as gp
from tests.laws.runs import SHORT, Driver, islanding, written

HERE = Path(__file__).parent
PROGRAM = {"command": [sys.executable, str(HERE / "consensus_program.py")]}


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The paper's law, exported as an FMU."""
    folder = tmp_path_factory.mktemp("fmu")
    source = str(HERE / "consensus_fmu.py")
    subprocess.run([sys.executable, "-m", "pythonfmu", "build", "-f", source, "-d", str(folder)], check=True)
    return {"fmu": "ConsensusFmu.fmu", "folder": str(folder)}


@pytest.mark.parametrize("driver", ["inprocess", "processes"])
@pytest.mark.parametrize("carrier", ["class", "program", "fmu"])
def test_every_carrier_of_a_law_gives_the_same_history(carrier: str, driver: Driver, fmu: dict[str, str]) -> None:
    """The paper's law built in, as anybody's class, as a program and as an FMU: one hash, in one process and in ten."""
    laws: dict[str, Any] = {"class": "agents.laws.consensus:Consensus", "program": PROGRAM, "fmu": fmu}
    result = written(laws[carrier], driver=driver)

    assert result.sha256 == islanding(short=True).sha256
    assert not list(result.events[result.events["kind"] == "law"]["text"])


def test_an_fmu_for_another_platform_is_refused_by_name(fmu: dict[str, str], tmp_path: Path) -> None:
    """It cannot be loaded here: one line says for which it is, before anything starts."""
    with zipfile.ZipFile(Path(fmu["folder"]) / fmu["fmu"]) as whole, zipfile.ZipFile(tmp_path / "x.fmu", "w") as other:
        for name in whole.namelist():
            if not name.startswith("binaries/") or "win64" in name:
                other.writestr(name, whole.read(name))
        if not any("win64" in name for name in whole.namelist()):
            other.writestr("binaries/win64/ConsensusFmu.dll", b"MZ")

    with pytest.raises(gp.ScenarioError, match=r"case.IV.law.fmu: x.fmu is for .*win64.*, and this is "):
        written({"fmu": "x.fmu", "folder": str(tmp_path)})


def test_an_fmu_has_the_parameters_that_it_declares(fmu: dict[str, str]) -> None:
    """A scenario gives them as those of any law; an unknown one is told with what there is."""
    slower = written({**fmu, "k_p": 0.0014})

    assert slower.sha256 == gp.load("islanding").replace({"gains.k_p": 0.0014, **SHORT}).run("IV").sha256
    with pytest.raises(gp.ScenarioError, match=re.escape('case.IV.law.k_pp: unknown parameter; did you mean "k_p"?')):
        written({**fmu, "k_pp": 1.0})
