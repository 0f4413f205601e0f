"""Runs by hand with the real commands, one terminal each, in the order of people."""

from __future__ import annotations

import json
import os
import re
import signal
from pathlib import Path

import pytest

from scenarios.drivers.rendezvous import rendezvous
from tests.processes.terminals import Desk, Terminal, wait_for

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
"""
"""Two events: the window of the first is over when the second happens, that of the second never is."""


def plant_of(desk: Desk, *words: str, wait: float = 0.0) -> Terminal:
    """Start the plant; it has begun when this returns, unless it waits for agents."""
    endpoint = desk.options[-1]
    plant = desk.open_bare("plant", "calm.toml", "--run", "lab", "--listen", endpoint, "--wait", f"{wait:g}", *words)
    plant.expect("t = 0; speed" if wait == 0.0 else "waits up to")
    return plant


def children_of(pid: int) -> list[int]:
    """Processes that the main thread of one has started."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_terminals_in_the_order_of_people(desk: Desk) -> None:
    """An agent before the plant, one after, one that is stopped and comes back, a switch, a look, and the end."""
    early = desk.open("agent", "inv2")
    early.expect("inv2: seeks the plant of run lab at tcp/127.0.0.1:")
    early.expect("inv2: no plant yet of run lab at .*; 2 of 60 s waited")
    plant = plant_of(desk, "--out", "here")
    early.expect("inv2: joins at t = ")
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
    plant.expect("NOTE  case IV: events that the scenario does not have: by hand at .* s: switch 13-152 opened")
    metrics = json.loads((desk.folder / "here" / "metrics.json").read_text())
    by_hand = metrics["by_hand"]
    assert [re.sub(r"^[0-9.]+ s  |;.*", "", line) for line in by_hand["departures"][-4:]] == [
        *("inv1 joined", "inv2 left", "inv2 joined", "switch 13-152 opened")
    ]
    ((label, window),) = by_hand["windows"].items()
    assert window == {"t_s": window["t_s"], "end_s": by_hand["ended_s"], "what": "switch 13-152 opened"}
    measured = metrics["cases"]["IV"][label]
    assert (measured["f_error_Hz"] is None) == ("f_error_Hz" in measured.get("reasons", {}))


def test_a_plant_waits_for_its_agents_as_long_as_told(desk: Desk) -> None:
    """It says for whom and how long, and starts without those who have not come."""
    first = desk.open("agent", "inv4")
    first.expect("inv4: seeks the plant")  # before the plant's time runs: how long a process takes to start is not told
    plant = plant_of(desk, wait=4.0)

    plant.expect("inv4 joined")
    plant.expect("started without the agents of inv1, inv2, inv3, inv5, ")
    first.expect("inv4: joins at t = ")


def test_ctrl_c_leaves_properly(desk: Desk) -> None:
    """The agent's inverter is off the network; the plant's agents stay and seek it when the plant goes."""
    plant = plant_of(desk)
    agents = [desk.open("agent", name) for name in ("inv1", "inv2")]
    for agent in agents:
        agent.expect("joins at t = ")

    agents[1].signal(signal.SIGINT)
    assert agents[1].end() == 130
    plant.expect("inv2 left; its inverter is off the network")
    plant.signal(signal.SIGINT)
    assert plant.end() == 130
    agents[0].expect("inv1: the plant is gone; holds, and seeks it again")


def test_a_plant_killed_and_started_again_has_its_agents_back(desk: Desk) -> None:
    """Kill -9 of the plant: the agents wait, visibly, and join its next life."""
    plant = plant_of(desk)
    agent = desk.open("agent", "inv1")
    agent.expect("inv1: joins at t = ")

    plant.signal(signal.SIGKILL)
    agent.expect("inv1: the plant is gone; holds, and seeks it again")
    plant_of(desk)
    agent.expect("inv1: joins at t = ")


def test_an_agent_killed_is_noticed_and_can_be_started_again(desk: Desk) -> None:
    """Kill -9 of an agent: its inverter stays on droop, and a new agent takes over at once."""
    plant = plant_of(desk)
    agent = desk.open("agent", "inv2")
    plant.expect("inv2 joined")

    agent.signal(signal.SIGKILL)
    plant.expect("inv2 died; its inverter stays on primary droop at its last set-points")
    desk.open("agent", "inv2").expect("inv2: joins at t = ")
    plant.expect("inv2 joined")


def test_a_frozen_agent_is_left_out_and_welcome_again(desk: Desk) -> None:
    """SIGSTOP: its neighbour goes on without it and `watch` says so; SIGCONT: it is heard again."""
    plant_of(desk)
    first, second = desk.open("agent", "inv1"), desk.open("agent", "inv2")
    for agent in (first, second):
        agent.expect("joins at t = ")
    watch = desk.open("watch")
    watch.expect(r"inv1 .* inv2 ")

    second.signal(signal.SIGSTOP)
    watch.expect(r"inv1 .*without inv2|inv2 .*(silent for|no agent)")
    second.signal(signal.SIGCONT)
    watch.expect(r"inv1 .* inv2 ")


def test_a_spare_inverter_comes_on_line_like_all_others(desk: Desk) -> None:
    """inv10 is off until its agent comes; then the others hear it."""
    plant = plant_of(desk)
    desk.open("agent", "inv1").expect("inv1: joins at t = ")
    desk.open("agent", "inv10").expect("inv10: joins at t = ")

    plant.expect("inv10 connected")
    watch = desk.open("watch")
    watch.expect(r"inv1 .* inv10 ")


def test_two_runs_side_by_side_do_not_meet(desk: Desk, tmp_path: Path) -> None:
    """Each plant sees its own agents alone; a wrong name is told the right ones."""
    plant_of(desk)
    with Desk(tmp_path, "--run", "other", "--connect", rendezvous()) as elsewhere:
        endpoint = elsewhere.options[-1]
        other = elsewhere.open_bare("plant", "calm.toml", "--run", "other", "--listen", endpoint, "--wait", "0")
        other.expect("t = 0; speed")
        desk.open("agent", "inv1").expect("inv1: joins at t = ")
        elsewhere.open("agent", "inv1").expect("inv1: joins at t = ")
        elsewhere.open("agent", "inv2").expect("inv2: joins at t = ")
        _, here = desk.type("status")
        _, there = elsewhere.type("status")
        mixed = elsewhere.open_bare("status", "--run", "lab", "--connect", endpoint, "--wait", "1")

        assert re.search(r"\ninv2 .* no agent\n", here)
        assert re.search(r"\ninv1 .* inv2 ", there)
        assert mixed.end() == 2
        assert f"no plant of run lab at {endpoint} within 1 s (runs there: other)" in mixed.text


def test_what_is_not_there_is_told_in_one_line(desk: Desk) -> None:
    """An agent without inverter, a second one of a name, nobody to stop, no such switch, a port in use: exit 2."""
    plant_of(desk)
    desk.open("agent", "inv2").expect("inv2: joins at t = ")
    endpoint = desk.options[-1]
    tries = {
        'no inverter "inv77" in run lab at .*; inverters are inv1, .*, inv9, inv10': ("agent", "inv77"),
        "inv2: another agent of this name takes part in run lab already": ("agent", "inv2"),
        'no agent "inv9" is running; running are: inv2': ("stop", "inv9"),
        'switch "13-15": no such switch': ("event", "open", "13-15"),
    }
    for said, words in tries.items():
        code, text = desk.type(*words)
        errors = [line for line in text.splitlines() if line.startswith("gridpeers: ")]

        assert code == 2, text
        assert len(errors) == 1, text
        assert re.search(said, errors[0])
        assert "Traceback" not in text
    second = desk.open_bare("plant", "calm.toml", "--run", "lab", "--listen", endpoint)
    assert second.end() == 2
    assert f"--listen: run lab is there already, at {endpoint}; gridpeers status --run lab " in second.text


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the children in /proc")
@pytest.mark.parametrize(
    ("words", "log"),
    [(("up", "--run", "lab", "--for", "4"), "log/plant.log"), (("run", "--clock", "wall"), "log/IV/plant.log")],
    ids=["up", "run"],
)
def test_a_window_in_which_an_agent_was_frozen_does_not_pass_as_clean(
    desk: Desk, words: tuple[str, ...], log: str
) -> None:
    """Frozen for less than Zenoh's lease, inv3 keeps its token; the window is flagged, and both ends are told."""
    (desk.folder / "events.toml").write_text(EVENTS.replace("t_s = 0.6", "t_s = 3.0").replace("3600.0", "4.0"))
    listen = ("--listen", desk.options[-1]) if words[0] == "up" else ()
    command = desk.open_bare(words[0], "events.toml", *words[1:], *listen, "--out", "here")
    told = desk.folder / "here" / log
    wait_for(told, "t = 0; speed 1")
    (inv3,) = [pid for pid in children_of(command.pid) if Path(f"/proc/{pid}/cmdline").read_text().endswith("inv3\0")]

    os.kill(inv3, signal.SIGSTOP)
    wait_for(told, "inv3 is silent: no state for 0.25 s, nothing comes from it")
    os.kill(inv3, signal.SIGCONT)
    wait_for(told, "inv3 is heard again")

    assert command.end() == 0
    command.expect(
        "NOTE  case IV: early, late: not what the scenario means by it, which does not tell of: .* inv3 is sil"
    )
    metrics = json.loads((desk.folder / "here" / "metrics.json").read_text())
    found = metrics["by_hand"] if words[0] == "up" else metrics["cases"]["IV"]
    assert found["disturbed"] == ["early", "late"]
    assert "inv3 is silent" in found["departures"][0]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the children in /proc")
@pytest.mark.parametrize(("by", "status"), [("down", 0), ("SIGINT", 130), ("SIGTERM", 143)])
def test_up_stays_until_it_is_ended_and_leaves_no_process(desk: Desk, by: str, status: int) -> None:
    """The plant and nine agents at once; `down`, Ctrl-C or SIGTERM end them all, with numbers beside the history."""
    (desk.folder / "events.toml").write_text(EVENTS)
    up = desk.open_bare("up", "events.toml", "--run", "lab", "--listen", desk.options[-1], "--out", "here")
    for _ in range(9):
        up.expect("inv[1-9] joined")
    children = children_of(up.pid)
    assert len(children) == 10
    desk.open("watch").expect(r"inv1 .* inv2-9 ")
    up.expect("0.60 s  switch 60-160 opened")

    if by == "down":
        assert desk.type("down")[0] == 0
    else:
        up.signal(signal.Signals[by])

    assert up.end() == status
    up.expect(r"ended at t = .* steps")
    for child in children:
        with pytest.raises(ProcessLookupError):
            os.kill(child, 0)
    up.expect(r"NOTE  case IV: ended at .* s, before the end of late \(0.6 to 3600 s\): they have no numbers")
    here = desk.folder / "here"
    assert (here / "status.txt").read_text() == "complete\n"
    assert sorted(path.name for path in (here / "IV").iterdir()) == ["events.csv", "history.csv"]
    metrics = json.loads((here / "metrics.json").read_text())
    assert metrics["by_hand"] | {"ended_s": 0.0} == {
        **{"ended_s": 0.0, "windows": {}, "too_short": []},
        **{"not_reached": ["late"], "disturbed": [], "departures": []},
    }
    early = metrics["cases"]["IV"]["early"]
    assert early["f_error_Hz"] is None  # 0.4 s after the event nothing is steady yet
    assert "last mean" in early["reasons"]["f_error_Hz"]
