"""GridLAB-D's process ends with the run, and a run that loses GridLAB-D ends with one clear error."""

from __future__ import annotations

import os
import re
import select
import signal
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.bridges.gridlabd.gridlabd_plant import DeltaModeProcess, GridlabdError
from gridpeers.plant.plant_config import PlantConfig, Protection
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import Telemetry
from tests.command_line import invoke
from tests.processes.terminals import children_of
from tests.toy.toy_runs import ProcessRun

pytestmark = pytest.mark.skipif(find_spec("gridlabd") is None, reason="the extra gridlabd is not installed")

PATIENCE = 100.0  # Deadline (s) of runs: GridLAB-D computes for seconds before it answers for the first time

TWO_CASES = (
    'name = "two"\n[time]\nend_s = {end}\n[plant]\nsimulator = "gridlabd"\n[processes]\ndeadline_s = 100.0\n'
    '[case.one]\nsecondary = "none"\ngraph = "none"\n[case.other]\nsecondary = "none"\ngraph = "none"\n'
)
"""A scenario of two short cases."""


def run_of(**changes: object) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Islanding at 0.04 s on GridLAB-D, with some settings of the plant changed."""
    plant, agents = configs(*load_scenario("islanding"), "IV")
    event = replace(plant.settings.events[0], t=0.04)
    settings = replace(plant.settings, simulator="gridlabd", events=(event,), **changes)
    plant = replace(plant, end=20.0, deadline=PATIENCE, settings=settings)
    return plant, tuple(replace(agent, deadline=PATIENCE) for agent in agents)


def in_one_process(**changes: object) -> Outcome:
    """Run it without other processes than GridLAB-D's."""
    return run_inprocess(*run_of(**changes), lambda telemetry: None)


def all_of(pid: int) -> list[int]:
    """Process ids of GridLAB-D that a process has started."""
    return [child for child in children_of(pid) if b"delta_mode.py" in Path(f"/proc/{child}/cmdline").read_bytes()]


@pytest.fixture
def gridlabd() -> Iterator[DeltaModeProcess]:
    """GridLAB-D without a model, and without patience."""
    process = DeltaModeProcess(deadline=0.2)
    yield process
    process.close()


def test_a_run_names_the_signal_that_killed_gridlabd() -> None:
    """After kill -9 of GridLAB-D the run breaks at once, and says when and how."""

    def kill(telemetry: Telemetry) -> None:
        for pid in all_of(os.getpid()):
            os.kill(pid, signal.SIGKILL)

    outcome = run_inprocess(*run_of(), kill)

    # the first telemetry, of t = 0, may be handed over before or after the first control period
    assert re.match(r"plant after t = 0(\.02)? s: GridLAB-D's process was killed by SIGKILL", outcome.broke)
    assert all_of(os.getpid()) == []


def test_gridlabd_ends_with_a_killed_plant(tmp_path: Path) -> None:
    """A plant that is killed by -9 cannot end GridLAB-D, which ends as nobody asks it any more."""
    run = ProcessRun(*run_of(), tmp_path)
    watched: list[int] = []

    def kill() -> None:
        plant = run.child("plant").pid
        for task in Path(f"/proc/{plant}/task").iterdir():
            watched.extend(os.pidfd_open(int(child)) for child in (task / "children").read_text().split())
        os.kill(plant, signal.SIGKILL)

    run.at(0.1, kill)
    outcome = run(plant_command=())

    assert "plant was killed by SIGKILL" in outcome.broke
    assert len(watched) == 1
    for each in watched:
        assert select.select([each], [], [], 60.0)[0] == [each]
        os.close(each)


def test_a_network_without_solution_ends_the_run_with_gridlabds_words() -> None:
    """An island with twice the load that it can feed diverges; the error has GridLAB-D's own lines."""
    plant, _ = run_of()
    outcome = in_one_process(
        changes=replace(plant.settings.changes, load_factor=2.0), protection=Protection(category="off")
    )

    assert outcome.broke.startswith("plant after t = 0.04 s: GridLAB-D: it ended its simulation before its time")
    assert "Newton-Raphson failed to converge" in outcome.broke


def test_a_model_that_gridlabd_refuses_is_an_error_with_its_words(gridlabd: DeltaModeProcess) -> None:
    """GridLAB-D's own message on a GLM reaches the user."""
    with pytest.raises(GridlabdError, match=r"(?s)GridLAB-D: it refuses the model.*nonsense"):
        gridlabd.load("module nonsense;\n", [])


def test_gridlabd_that_does_not_answer_is_named(gridlabd: DeltaModeProcess) -> None:
    """A process that stands still does not hold up the run for ever."""
    os.kill(gridlabd.pid, signal.SIGSTOP)

    with pytest.raises(GridlabdError, match=r"GridLAB-D has not answered for 0\.2 s, so it was ended"):
        gridlabd.ask(advance=1)


def test_a_damaged_wheel_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that is there and cannot be imported ends the command with 2, and a plant with the same reason."""
    (tmp_path / "gridlabd.py").write_text("raise ImportError('libdamaged.so')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    code, text = invoke("run", "islanding", "--plant", "gridlabd")

    assert (code, text.count("\n")) == (2, 1)
    assert "gridlabd is installed, but cannot be imported (ImportError: libdamaged.so)" in text
    process = DeltaModeProcess(deadline=1.0)
    with pytest.raises(
        GridlabdError,
        match=r"cannot be imported \(ImportError: libdamaged.so\); GridLAB-D as the plant needs it: pip install",
    ):
        process.load("", [])
    process.close()


def test_gridlabd_keeps_no_real_time(tmp_path: Path) -> None:
    """A second of it takes more than a second, so real time is refused in one line."""
    (tmp_path / "mine.toml").write_text(TWO_CASES.format(end=1.0))
    code, text = invoke("run", "islanding", "--plant", "gridlabd", "--clock", "realtime")

    assert code == 2
    assert text.startswith('gridpeers: --clock realtime: the plant of "gridlabd" cannot run in real time; use ')
    for live in ("plant", "up"):
        code, text = invoke(live, str(tmp_path / "mine.toml"), "--listen", "tcp/127.0.0.1:0")
        assert (code, text.count("\n")) == (2, 1)
        assert 'plant.simulator = "gridlabd": cannot run in real time' in text
