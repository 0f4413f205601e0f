"""One law, four carriers, two drivers: the same history to the byte."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.laws.runs import Driver, islanding, written

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
