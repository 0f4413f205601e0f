"""Live runs with the real commands, one terminal each, in the order of people."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from tests.command_line import invoke
from tests.processes.commands.test_run_command import command
from tests.processes.terminals import DEADLINE, Desk, Terminal, children_of, wait_for_the_end_of

EVENTS = """
[time]
end_s = 3600.0
[[event]]
label = "early"
t_s = 0.2
open = ["13-152"]
[[event]]
label = "late"
t_s = 0.6
open = ["60-160"]
[case.IV]
secondary = "all"
graph = "full"
degraded_communication = { max_age_s = 60.0 }
without_agent = ["inv4", "inv5", "inv6", "inv7", "inv8", "inv9"]
"""
"""Three agents and two events: the window of the first is over when the second happens, that of the second never is.

A busy machine may leave an agent out for longer than the usual greatest age of 0.25 s, which is a departure of the run.
"""


def plant_of(desk: Desk, *words: str, wait: float = 0.0) -> Terminal:
    """Start the plant; it has begun when this returns, unless it waits for agents."""
    endpoint = desk.options[-1]
    plant = desk.open_bare("plant", "calm.toml", "--run", "lab", "--listen", endpoint, "--wait", f"{wait:g}", *words)
    plant.expect("t = 0; speed" if wait == 0.0 else "waits up to")
    return plant


def test_terminals_in_the_order_of_people(desk: Desk) -> None:
    """An agent before the plant, one after, one that is stopped and comes back, a switch, a look, and the end.

    The plant says for whom it waits and how long, and starts without those who have not come.
    """
    early = desk.open("agent", "inv2")
    early.expect("inv2: looks for the plant of run lab at tcp/127.0.0.1:")
    early.expect(r"inv2: no plant yet of run lab at .*; gridpeers up SCENARIO --run lab starts one; \d+ s left")
    plant = plant_of(desk, "--out", "here", wait=3.0)
    without = plant.expect("started without the agents of (inv1, .*inv3, inv4, .*)")
    early.expect("inv2: joins at t = ")
    plant.shows("inv2 joined")  # within the 3 s, unless the machine is busy
    came = plant.text.index("inv2 joined") < plant.text.index(without[0])
    assert ("inv2" in without[1]) == (not came)
    late = desk.open("agent", "inv1")
    late.expect("inv1: joins at t = ")
    watch = desk.open("watch")
    watch.expect(r"inv1 .* inv2 ")

    code, text = desk.type("stop", "inv2")
    assert (code, early.end()) == (0, 0)
    assert text.startswith("inv2 was asked to leave at t = ")
    plant.expect("inv2 left; its inverter is off the network")
    watch.expect(r"inv2 +- .* no agent")

    again = desk.open("agent", "inv2")
    again.expect("inv2: joins at t = ")
    watch.expect(r"inv1 .* inv2 ")
    code, text = desk.type("load", "48x", "--factor", "2")
    assert (code, text) == (2, 'gridpeers: load "48x": no such load; did you mean "48"?\n')
    code, text = desk.type("load", "48", "--factor", "1.5")
    told = "load 48: 315 kW and 225 kvar at nominal voltage, 1.5 times its table"
    assert (code, text.partition(", at t")[0]) == (0, told)
    code, text = desk.type("event", "open", "13-152")
    assert code == 0
    plant.expect(r"\d s  switch 13-152 opened")
    watch.expect(r"inv1 +inv1 ")
    code, text = desk.type("status")
    assert code == 0
    assert re.match(r"run lab   t = \d+\.\d\d s   speed 1   pace: .* of steps in time .*   islands: inv1\n", text)
    assert re.search(r"\n +\d+\.\d\d s  switch 13-152 opened\n", text)
    assert re.search(r"\ninv9 +- .* no agent\n", text)

    code, text = desk.type("down")
    assert code == 0
    assert text.startswith("run lab ends at t = ")
    assert [terminal.end() for terminal in (plant, again, late)] == [0, 0, 0]
    plant.expect("NOTE  case IV: people gave 3 commands")
    assert json.loads((desk.folder / "here" / "metrics.json").read_text())["cases"]["IV"]["commands"] == 3
    events = (desk.folder / "here" / "IV" / "events.csv").read_text()
    assert re.findall(",command,([^,]*),", events) == ["inv2", "48", "13-152"]


def status_of_another_run(endpoint: str) -> tuple[int, str]:
    """Ask for a run that does not exist, longer if the machine is too busy for a link to the other run."""
    for wait in ("1", "8", "40"):
        code, text = invoke("status", "--run", "other", "--connect", endpoint, "--wait", wait)
        if "runs there" in text:
            break
    return code, text


def test_what_is_not_there_is_told_in_one_line(desk: Desk) -> None:
    """No inverter, a second agent of a name, no such switch, no such run, a run that exists: exit code 2."""
    plant_of(desk)
    desk.open("agent", "inv2").expect("inv2: joins at t = ")
    endpoint = desk.options[-1]
    agents = [desk.open("agent", name) for name in ("inv77", "inv2")]
    second = desk.open_bare("plant", "calm.toml", "--run", "lab", "--listen", endpoint)
    said = {
        'no inverter "inv77" in run lab at .*; inverters are inv1, .*, inv9, inv10': (agents[0].end(), agents[0].text),
        "inv2: another agent of this name takes part in run lab already": (agents[1].end(), agents[1].text),
        'no agent "inv9" is running; running are: inv2': desk.type("stop", "inv9"),
        'switch "13-15": no such switch': desk.type("event", "open", "13-15"),
        rf"no plant of run other at {endpoint} within \d+ s \(runs there: lab\)": status_of_another_run(endpoint),
    }
    for what, (code, text) in said.items():
        errors = [line for line in text.splitlines() if line.startswith("gridpeers: ")]

        assert code == 2, text
        assert len(errors) == 1, text
        assert re.search(what, errors[0])
        assert "Traceback" not in text
    assert second.end() == 2
    assert "address already in use; end its user (gridpeers down ends a live run" in second.text


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the children in /proc")
def test_up_stays_until_it_is_ended_and_leaves_no_process(desk: Desk) -> None:
    """The plant and its agents at once; SIGTERM, twice as `timeout` sends it, ends them all, with numbers."""
    (desk.folder / "events.toml").write_text(EVENTS)
    up = desk.open_bare("up", "events.toml", "--run", "lab", "--listen", desk.options[-1], "--out", "here")
    for _ in range(3):
        up.expect("inv[1-3] joined")
    children = children_of(up.pid)
    assert len(children) == 4
    up.expect("0.60 s  switch 60-160 opened")

    for _ in range(2):
        up.signal(signal.SIGTERM)

    assert up.end() == 143
    up.expect(r"ended at t = .* steps")
    wait_for_the_end_of(children)
    up.expect(r"NOTE  case IV: ended at .* s of 3600 s; the measures end")
    here = desk.folder / "here"
    events = (here / "IV" / "events.csv").read_text()
    assert " left" not in events
    assert " died" not in events
    assert (here / "status.txt").read_text() == "complete\n"
    assert sorted(path.name for path in (here / "IV").iterdir()) == ["events.csv", "history.csv", "run.mcap"]
    case = json.loads((here / "metrics.json").read_text())["cases"]["IV"]
    assert "commands" not in case
    early = case["early"]
    assert early["f_error_Hz"] is None  # 0.4 s after the event nothing is steady yet
    assert "last mean" in early["reasons"]["f_error_Hz"]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the children in /proc")
def test_a_log_that_the_end_of_up_names_is_there(desk: Desk) -> None:
    """Without `--out` logs are in a temporary folder, which stays if the plant dies."""
    up = desk.open_bare("up", "calm.toml", "--run", "lab", "--listen", desk.options[-1])
    up.expect("inv1 joined")
    (plant,) = (
        child
        for child in children_of(up.pid)
        if (Path("/proc") / str(child) / "cmdline").read_bytes().endswith(b"plant\0")
    )
    os.kill(plant, signal.SIGKILL)

    assert up.end() == 3
    log = Path(up.expect("Whole log: (.*plant.log)")[1])
    assert log.exists()
    shutil.rmtree(log.parent)


def test_a_plant_and_an_agent_go_on_when_nobody_reads_their_log(desk: Desk) -> None:
    """They serve until the end of the run, as if somebody read, and print no error."""
    endpoint = desk.options[-1]
    reading, closed_pipe = os.pipe()
    os.close(reading)
    plant = ["plant", "calm.toml", "--run", "lab", "--listen", endpoint, "--wait", "0"]
    agent = ["agent", "inv1", "--run", "lab", "--connect", endpoint]
    started = [
        subprocess.Popen(command(*words), cwd=desk.folder, stdout=closed_pipe, stderr=subprocess.PIPE, text=True)
        for words in (plant, agent)
    ]
    os.close(closed_pipe)
    try:
        desk.open("watch", "--wait", f"{DEADLINE:g}").expect(r"inv1 +grid +\d")
        code, text = desk.type("down")

        assert code == 0, text
        assert [(process.communicate(timeout=DEADLINE)[1], process.returncode) for process in started] == [("", 0)] * 2
    finally:
        for process in started:
            process.kill()
            process.communicate()


LAW = """import os
import gridpeers as gp

class Mine(gp.Law):
    def step(self, own, neighbours, T):
        if own.name == "inv3":
            os._exit(0)
        return gp.SetPoints(own.P_set / (own.name > "inv2"), own.V_set)
"""
"""It ends the process of inv3 and raises in inv1 and inv2 as the island forms."""


def test_laws_that_fail_in_a_live_run_are_exit_code_1_and_named(desk: Desk) -> None:
    """A law that raises is named by file and line, and an exit status 0 hides no end. The report says it first."""
    (desk.folder / "mine.py").write_text(LAW)
    (desk.folder / "events.toml").write_text(f'law = "mine:Mine"\n{EVENTS}')
    up = desk.open_bare("up", "events.toml", "--run", "lab", "--listen", desk.options[-1], "--out", "here")
    for name in ("inv1", "inv2"):
        up.shows(f"{name}: law mine:Mine (mine.py:8): step at t = ")
    up.shows("inv3 exited with status 0 after t = ")
    up.shows("inv3: its process exited with status 0")

    assert desk.type("down")[0] == 0
    assert up.end() == 1
    up.expect("FAILED  case IV: inv[123]: ")
    assert re.match(
        r"FAILED  case IV: inv[123] at t = .* s: .* and 2 more\n", (desk.folder / "here" / "report.txt").read_text()
    )


SCRIPT = Path(__file__).parents[3] / "examples" / "live_run.py"


def test_a_live_run_is_changed_by_commands_and_read_at_its_end(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A link is made late, an agent leaves, and the record has both. Its commands beside `up` run in this process."""

    def run(words: list[str], *, check: bool) -> None:
        assert words[:3] == [sys.executable, "-m", "gridpeers"]
        code, text = invoke(*words[3:])
        assert (code, check) == (0, True), text

    monkeypatch.setattr(sys, "argv", [str(SCRIPT), free_endpoint()])
    monkeypatch.setattr(subprocess, "run", run)
    runpy.run_path(str(SCRIPT), run_name="__main__")

    printed = capsys.readouterr().out
    assert "inv2 left; its inverter is off the network" in printed
    assert "link command 1: inv1 <-> inv4: delay 0.1" in printed
    assert "P of inv2 at the end: 0 W" in printed
    assert [path.name for path in elsewhere.iterdir()] == ["live_run.png"]
