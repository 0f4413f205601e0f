"""Real processes that are killed, frozen, doubled and orphaned. The plant is a toy; all else is the real thing."""

from __future__ import annotations

import hashlib
import json
import os
import re
import select
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic

import msgspec
import pytest

from gridpeers.agents.agent_config import AgentConfig, Control, LawChoice
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.wire.codec import decode
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Waiting
from tests.toy import toy_plant
from tests.toy.toy_configs import agent_config, toy_configs
from tests.toy.toy_plant import ToyPlant
from tests.toy.toy_runs import ProcessRun, Rows

LONG = 2000.0  # An end (s) that no test waits for


def last_P_set(row: tuple[float, ...], inverter: int) -> float:
    """P_set (W) of an inverter in a row."""
    return row[5 + 6 * (inverter - 1)]


def killed_after(name: str, text: str) -> float:
    """The time (s) that a message about somebody who was killed names."""
    match = re.match(rf"{name} was killed by SIGKILL after t = ([0-9.]+) s", text)
    assert match is not None, text
    return float(match[1])


def test_an_agent_killed_in_mid_run_is_reported_and_the_run_goes_on(tmp_path: Path) -> None:
    """Kill -9: the run reaches its end, says who died and when, and is not reproducible; the rest restore 60 Hz."""
    run = ProcessRun(*toy_configs(4, end=20.0), tmp_path)  # long: the plant goes on while telemetry comes here
    run.at(0.4, lambda: run.child("inv3").signal(signal.SIGKILL))
    outcome = run()
    deaths = [event for event in outcome.events if event.kind == "roster"]

    assert outcome.broke == ""
    assert not outcome.reproducible
    assert [event.subject for event in deaths] == ["inv3"]
    assert "its inverter stays on primary droop at its last set-points" in deaths[0].text
    assert run.rows[-1][0] == 20.0
    assert run.rows[-1][1] == pytest.approx(60.0, abs=0.01)
    assert last_P_set(run.rows[-1], 3) == last_P_set(run.rows[round(deaths[0].t / 0.02) + 2], 3)
    assert len(outcome.notes) == 1
    assert 0.4 <= killed_after("inv3", outcome.notes[0]) <= 20.0  # the command may notice it later than the plant does
    assert outcome.notes[0].endswith(f"Whole log: {tmp_path / 'inv3.log'}")


def test_an_agent_that_crashes_breaks_the_run(tmp_path: Path) -> None:
    """A segmentation fault, as in C code of a law, is no kill from outside: the run is no success, and names it."""
    run = ProcessRun(*toy_configs(4, end=LONG), tmp_path)
    run.at(0.4, lambda: run.child("inv3").signal(signal.SIGSEGV))
    outcome = run()

    assert outcome.broke.startswith("inv3 was killed by SIGSEGV after t = "), outcome.broke


QUITS = """import os, sys
import gridpeers as gp

class Mine(gp.Law):
    def step(self, own, neighbours, T):
        if own.name == "inv3" and own.t > 0.3:
            print("no licence", file=sys.stderr, flush=True)
            os._exit({status})
        return gp.SetPoints(own.P_set, own.V_set)
"""


def quitting(folder: Path, status: int) -> Control:
    """Return a rule whose law ends the process of inv3 at 0.3 s, as a library does that calls exit()."""
    (folder / "quits.py").write_text(QUITS.format(status=status))
    return Control(secondary="all", graph="full", law=LawChoice(use="quits:Mine", folder=str(folder)))


@pytest.mark.parametrize(("status", "end"), [(3, 20.0), (0, 0.36)])
def test_an_agent_that_ends_its_process_breaks_the_run(status: int, end: float, tmp_path: Path) -> None:
    """Whatever its exit status says, and also if the others reach the end first. Its last words are told."""
    outcome = ProcessRun(*toy_configs(4, quitting(tmp_path, status), end=end), tmp_path / "log")()

    assert re.match(rf"inv3 exited with status {status} (after|at) t = ", outcome.broke), outcome.broke
    assert "\n    no licence\n" in outcome.broke


def test_an_agent_that_ends_its_process_fails_a_run_in_real_time(tmp_path: Path) -> None:
    """The run goes on, as the others would, and its record has the event that a failed law has."""
    plant, agents = toy_configs(4, quitting(tmp_path, 0), end=1.0)
    plant = msgspec.structs.replace(plant, clock="realtime")
    run = ProcessRun(plant, [msgspec.structs.replace(agent, clock="realtime") for agent in agents], tmp_path / "log")
    outcome = run()
    (failed,) = law_failures(run.events)

    assert (outcome.broke, run.rows[-1][0]) == ("", 1.0)
    assert (failed.agent, failed.why) == ("inv3", "its process exited with status 0")
    assert "\n    no licence\n" in outcome.notes[0]


def test_agents_that_link_to_each_other_give_the_same_rows(tmp_path: Path) -> None:
    """Bytes do not depend on whether the plant relays, as in all other tests, or all have links to all."""
    star, mesh = (ProcessRun(*toy_configs(4, end=2.0), tmp_path / name) for name in ("star", "mesh"))

    assert [star().broke, mesh(star=False).broke] == ["", ""]
    assert mesh.rows == star.rows


def test_a_plant_killed_in_mid_run_ends_it(tmp_path: Path) -> None:
    """Kill -9: the run ends by this, not by its deadline, and says who died, when, and where its log lies."""
    run = ProcessRun(*toy_configs(4, end=LONG), tmp_path)
    run.at(0.4, lambda: run.child("plant").signal(signal.SIGKILL))
    outcome = run()

    assert 0.4 <= killed_after("plant", outcome.broke) < LONG
    assert outcome.broke.endswith(f"Whole log: {tmp_path / 'plant.log'}")
    assert not outcome.reproducible


def test_a_frozen_agent_is_named_by_the_deadline(tmp_path: Path) -> None:
    """SIGSTOP: who neither answers nor dies is named, with its last tick and its last sign of life."""
    run = ProcessRun(*toy_configs(3, end=LONG, deadline=3.0), tmp_path)
    run.at(0.4, lambda: run.child("inv2").signal(signal.SIGSTOP))
    outcome = run()

    assert outcome.broke.startswith("plant: no State(")
    assert ") from inv2 within 3 s; last heard of inv2: tick " in outcome.broke
    if "inv1" in outcome.broke:  # frozen between two sends, inv2 keeps the others waiting, who are missed as well
        assert ") from inv3 within 3 s" in outcome.broke


def test_who_cannot_start_ends_the_run_at_once(tmp_path: Path) -> None:
    """An agent that dies before t = 0 is reported with its exit status, its last lines and its log."""
    plant, agents = toy_configs(3)
    bad = msgspec.structs.replace(agents[1], listen=("tcp/256.0.0.1:0",))
    outcome = ProcessRun(plant, (agents[0], bad, agents[2]), tmp_path)(star=False)

    assert outcome.broke.startswith("inv2 exited with status 2 before t = 0. Its last lines:")
    assert "cannot open a Zenoh session (listening on tcp/256.0.0.1:0)" in outcome.broke


def test_an_agent_that_is_asked_to_leave_before_the_start_ends_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its exit status is 0, and the plant would wait for it until the deadline."""
    run = ProcessRun(*toy_configs(3), tmp_path)
    monkeypatch.setattr(run, "_started", lambda children: children["inv2"].signal(signal.SIGINT))

    assert run().broke.startswith("inv2 exited with status 0 before t = 0. Its last lines:")


PARENT = """
import json, sys
from pathlib import Path
from gridpeers.scenarios.drivers.process_driver import run_processes
from tests.toy.toy_configs import toy_configs
plant, agents = toy_configs(3, end=2000.0)
def told(children):
    pids = [child.pid for child in children]
    def take(telemetry):
        print(json.dumps(pids), flush=True)
    return take
takes = []
run_processes(plant, agents, Path(sys.argv[1]), lambda telemetry: takes[0](telemetry),
              on_start=lambda children: takes.append(told(children)), plant_command=(sys.argv[2],))
"""


RECORDER = """
import hashlib, sys
from pathlib import Path
import msgspec
from gridpeers.scenarios.drivers.process_driver import run_processes
from tests.processes.lockstep.test_process_driver import wide_rows
plant, agents = wide_rows()
rows = []
def take(telemetry):
    rows.extend(telemetry.rows)
    print(telemetry.t, flush=True)
outcome = run_processes(msgspec.structs.replace(plant, listen=(sys.argv[3],)), agents, Path(sys.argv[1]), take,
                        plant_command=(sys.argv[2],))
print(repr(outcome.broke), outcome.reproducible, hashlib.sha256(repr(rows).encode()).hexdigest())
"""


def wide_rows() -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """A run of two agents on 60 inverters: a megabyte of rows, for which the plant does not wait, takes 6 s."""
    plant, agents = toy_configs(60, end=20.0)
    return msgspec.structs.replace(plant, agents=("inv1", "inv2")), agents[:2]


def test_the_plant_waits_for_a_command_that_stands_still(tmp_path: Path) -> None:
    """SIGSTOP, as by Ctrl-Z: the plant says that it waits; after SIGCONT the run goes on, and misses no row."""
    endpoint = free_endpoint()
    command = [sys.executable, "-c", RECORDER, str(tmp_path), toy_plant.__file__, endpoint]
    root = Path(toy_plant.__file__).parents[2]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root) as recorder:
        assert recorder.stdout is not None
        recorder.stdout.readline()
        recorder.send_signal(signal.SIGSTOP)
        watcher = Session("watcher", connect=(endpoint,), gossip=False)
        watcher.subscribe(Keys("toy").control)
        while not (events := watcher.take(1, None)):
            pass
        watcher.close()
        recorder.send_signal(signal.SIGCONT)
        last = recorder.stdout.read().splitlines()[-1]
    rows: Rows = []
    plant, agents = wide_rows()
    run_inprocess(plant, agents, lambda telemetry: rows.extend(telemetry.rows), plant=ToyPlant(plant))

    waiting = decode(events[0][2])
    assert isinstance(waiting, Waiting)
    assert waiting.waits_for == ("history",)
    assert waiting.t < plant.end
    assert last == f"'' True {hashlib.sha256(repr(rows).encode()).hexdigest()}"


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="watches processes that are not its children by pidfd")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_end_of_the_parent_is_the_end_of_all(number: signal.Signals, tmp_path: Path) -> None:
    """Neither Ctrl-C nor kill -9 of the parent leaves a process."""
    command = [sys.executable, "-c", PARENT, str(tmp_path), toy_plant.__file__]
    root = Path(toy_plant.__file__).parents[2]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd=root) as parent:
        assert parent.stdout is not None
        pids = json.loads(parent.stdout.readline())
        watched = {os.pidfd_open(pid): pid for pid in pids}
        parent.send_signal(number)
        parent.stdout.close()
        until = monotonic() + 60.0
        left = dict(watched)
        while left and monotonic() < until:
            ended, _, _ = select.select(list(left), [], [], until - monotonic())
            left = {fd: pid for fd, pid in left.items() if fd not in ended}
        for fd in watched:
            os.close(fd)
        parent.wait(timeout=60.0)

    assert len(pids) == 4
    assert left == {}


@pytest.mark.parametrize("module", ["gridpeers.agents", "gridpeers.plant"])
def test_a_bad_configuration_is_refused(module: str) -> None:
    """Status 2 and what is wrong where, as msgspec says it."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", module], input=b'{"run": 1}', capture_output=True, timeout=60, check=False
    )

    assert done.returncode == 2
    assert b"Expected `str`, got `int` - at `$.run`" in done.stderr


def test_an_agent_alone_gives_up() -> None:
    """Without a rendezvous it says after its deadline what it waited for and where."""
    config = msgspec.structs.replace(agent_config("inv1", deadline=0.2), connect=("tcp/127.0.0.1:9",))
    done = subprocess.run(
        [sys.executable, "-P", "-m", "gridpeers.agents"],
        input=msgspec.json.encode(config),
        capture_output=True,
        timeout=60,
        check=False,
    )

    assert done.returncode == 3
    assert b"inv1: no sign of life from plant within 0.4 s" in done.stderr
    assert b"is the plant of run toy running at tcp/127.0.0.1:9?" in done.stderr
