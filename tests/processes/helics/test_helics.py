"""HELICS: a real broker, and federates of others in processes of their own; all on the loopback."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import gridpeers
from gridpeers import Scenario
from gridpeers.bridges.helics.federate import HELD, HelicsError, HelicsFederate, events, topics
from gridpeers.bridges.helics.helics_simulator import HelicsSettings
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.run_request import BrokenRunError
from tests.command_line import invoke

pytest.importorskip("helics", reason="needs HELICS: pip install 'gridpeers[helics]'")

HERE = Path(__file__).parent
EXAMPLE = Path(__file__).parents[3] / "examples" / "helics_federate.py"
STRANGE = HERE / "strange_federate.py"


BROKER = (  # A broker that prints its warnings, as `helics_broker` does
    "import sys, helics\n"
    "broker = helics.helicsCreateBroker('zmq', '', f'-f {sys.argv[2]} --localinterface={sys.argv[1]}')\n"
    "helics.helicsBrokerWaitForDisconnect(broker, 60000)\n"
)


def free_broker() -> str:
    """Address at which a broker can be started."""
    return free_endpoint("tcp/127.0.0.1:0").replace("/", "://")


def short(end: float, broker: str, deadline: float = 30.0, wait: float = 30.0, **changes: Any) -> Scenario:
    """The islanding scenario on a grid outside, sooner and shorter, which waits so long (s) for the begin."""
    events = [{"label": "islanding", "t_s": 0.1, "open": ["13-152"]}]
    helics = {"broker": broker, "wait_s": wait}
    common = {"time.end_s": end, "event": events, "paper": "", "processes.deadline_s": deadline}
    plant = {"plant.simulator": "helics", "plant.helics": helics}
    return gridpeers.load("islanding").replace(common | plant | changes)


@contextmanager
def broker_for(federates: int) -> Iterator[str]:
    """A broker that waits for so many federates; yields its address."""
    address = free_broker()
    with federate("-c", BROKER, address, str(federates)):
        yield address


@contextmanager
def federate(*words: str | Path) -> Iterator[subprocess.Popen[str]]:
    """A process of somebody else that is gone afterwards."""
    with subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as one:
        try:
            yield one
        finally:
            one.kill()


def left_behind() -> list[str]:
    """Commands of federates of ours that this process has started and that still run."""
    pids = [pid for file in Path("/proc/self/task").glob("*/children") for pid in file.read_text().split()]
    commands = [Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ") for pid in pids]
    return [command for command in commands if "federate_process" in command]


def test_our_agents_control_a_grid_of_somebody_else_alike_under_both_drivers() -> None:
    """A federate that imports helics alone: sharing is equal at the end, and the bytes are the same."""
    results = []
    for driver in ("inprocess", "processes"):
        with broker_for(2) as broker, federate(EXAMPLE, broker, "1.5") as grid:
            results.append(short(1.5, broker, **{"event[0].t_s": 1.0}).run("IV", driver=driver))
            assert grid.wait(timeout=100) == 0

    assert results[0].sha256 == results[1].sha256
    assert results[0].metrics.loc["islanding", "MPSI"] < 0.01
    assert results[0].metrics.loc["islanding", "f_error_Hz"] < 0.01


@pytest.mark.parametrize(("what", "said", "deadline", "wait"), [
    ("error", "t = 0.09 s: the federation ended: no solution of my power flow", 30.0, 30.0),
    ("hangs", "strange did not let time go on to 0.1 s within 2 s; end what hangs", 2.0, 30.0),
    ("not beginning", "did not begin within 1 s (are all started?)", 30.0, 1.0),
])  # fmt: skip
def test_a_federate_of_others_that_fails_ends_the_run_with_one_line(
    what: str, said: str, deadline: float, wait: float
) -> None:
    """It names the topic or the federate and the time, within the deadline of the scenario; nothing hangs."""
    with broker_for(2) as broker, federate(STRANGE, broker, what), pytest.raises(BrokenRunError) as error:
        short(0.2, broker, deadline, wait).run("IV")

    assert said in str(error.value)
    assert "\n" not in str(error.value)
    assert not left_behind()


def test_one_of_two_plants_that_leaves_ends_the_run_too() -> None:
    """Its inverters would stand still for ever, while those of the other move on."""
    with (
        broker_for(3) as broker,
        federate(STRANGE, broker, "good", "north", "1", "4"),
        federate(STRANGE, broker, "leaves", "south", "5", "9"),
        pytest.raises(BrokenRunError, match="s: south left the federation"),
    ):
        short(0.2, broker).run("IV")


def test_a_broker_that_is_missing_is_one_line() -> None:
    """The line has its address, and the command that starts one."""
    broker = free_broker()

    with pytest.raises(BrokenRunError, match=f"no broker at {broker} within 0.9 s .*helics_broker -f 2"):
        short(0.2, broker, 1.0).run("IV")


def test_a_broker_of_others_warns_of_no_topic_that_may_be_missing() -> None:
    """Optional topics that nobody publishes are no warning in its log, where one of theirs would be lost among them."""
    address = free_broker()
    with federate("-c", BROKER, address, "1") as broker:
        me = HelicsFederate(HelicsSettings(broker=address, name="me"), 30.0)
        federation = me.begin([], [events("grid"), *topics("grid", ["inv1"], HELD)])
        me.end()
        printed = broker.communicate(timeout=60)[0]

    assert federation["missing"] == ["grid/events", "grid/inv1/P_set_held", "grid/inv1/V_set_held"]
    assert printed == ""


def test_a_wheel_that_cannot_be_imported_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says why, and what to install; the command finds out before it starts anything."""
    (tmp_path / "helics.py").write_text("raise ImportError('none')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    with pytest.raises(
        HelicsError, match=r"cannot be imported \(ImportError: none\); a HELICS federate needs it: pip install --force"
    ):
        HelicsFederate(HelicsSettings(), 5.0)

    code, text = invoke("run", "islanding", "--case", "IV", "--plant", "helics")
    assert (code, text.count("\n")) == (2, 1)
    assert "helics is installed, but cannot be imported (ImportError: none)" in text
