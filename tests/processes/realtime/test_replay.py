"""Runs in wall-clock time, replayed: the same cores decide the same, and what would have been follows from it."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace as replaced

import gridpeers as gp
from gridpeers.lab.replay.replay import replay
from gridpeers.runs.result import Result
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.journal import ProcessEvent
from tests.command_line import invoke
from tests.processes.terminals import Desk
from tests.record.killed_commands import killed

ISLANDING = {"label": "islanding", "t_s": 0.5, "open": ["13-152"]}
ALL = {"secondary": "all", "graph": "full"}

SCENARIOS: dict[str, dict[str, Any]] = {
    "islanding": {"time": {"end_s": 2.0}, "event": [ISLANDING], "case": {"IV": ALL}},
    "plug-n-play": {
        "time": {"end_s": 3.2},
        "plant": {"load_set": "main"},
        "event": [
            ISLANDING,
            {"label": "leave", "t_s": 0.8, "leave": ["inv2"]},
            {"label": "return", "t_s": 1.2, "join": ["inv2"]},
        ],
        "case": {"IV": ALL},
    },
    "lossy": {
        "time": {"end_s": 2.0},
        "seed": 7,
        "event": [ISLANDING],
        "case": {"IV": ALL | {"link": [{"on": "* <-> *", "loss": 0.2}]}},
    },
}

_results: dict[str, Result] = {}


@pytest.fixture(scope="module")
def run_of() -> Callable[[str], Result]:
    """Run a scenario in wall-clock time with a process for each agent, once."""

    def run(name: str) -> Result:
        if name not in _results:
            scenario = gp.Scenario(name=name, **SCENARIOS[name])
            _results[name] = scenario.run("IV", driver="processes", clock="wall")
        return _results[name]

    return run


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_replay_gives_the_set_points_of_the_run(name: str, run_of: Callable[[str], Result]) -> None:
    """Every state of every process, and every row of the plant, is the same within 1e-9."""
    run = run_of(name)

    done = gp.replay(run)

    assert done.difference is None
    assert done.notes == ()
    plant, *agents = done.parts
    assert plant.count == len(run.history)
    assert {part.name for part in agents} == {f"inv{k}" for k in range(1, 10)}
    assert len(agents) == (10 if name == "plug-n-play" else 9)  # a process of its own for who returns
    assert min(part.count for part in agents) > 0
    assert max(part.t_end for part in agents) > run.spec.time.end_s - 0.5


@pytest.mark.parametrize("name", ["plug-n-play", "lossy"])
def test_a_loop_without_a_change_gives_the_run_back(name: str, run_of: Callable[[str], Result]) -> None:
    """What each process hears is what the others send in the replay; so nothing of the record is needed but times."""
    run = run_of(name)

    done = gp.counterfactual(run)

    assert done.difference is None
    assert done.compared == len(run.history)
    assert done.would_be.sha256 == run.sha256
    assert done.table["difference"].abs().max() == 0.0
    assert done.would_be.events.equals(done.was.events)


def test_what_is_lost_comes_without_loss(run_of: Callable[[str], Result]) -> None:
    """From its time on no message is lost; before it the same ones are, in the same order."""
    run = run_of("lossy")

    done = gp.counterfactual(run, without_loss=True, since=1.0)

    assert done.difference is None
    was, would_be = ([frame[frame["t"] < 1.0], frame[frame["t"] >= 1.0]] for frame in (run.links, done.would_be.links))
    assert was[1]["fate"].eq("loss").sum() > 100
    assert not would_be[1]["fate"].eq("loss").any()
    lost = [frame[frame["fate"] == "loss"][["src", "dst", "seq"]] for frame in (was[0], would_be[0])]
    assert len(lost[0]) > 100
    assert {tuple(row) for row in lost[0].to_numpy()} == {tuple(row) for row in lost[1].to_numpy()}


def test_a_cut_link_is_one_from_its_time_on(run_of: Callable[[str], Result]) -> None:
    """Up to then all is as it was, to the bit; then inverter 4, which hears nobody any more, goes its own way."""
    run = run_of("islanding")

    done = gp.counterfactual(run, without="* -> inv4", since=0.9)

    assert done.difference is None
    was, would_be = run.record, done.would_be.record
    before = was.t <= 0.9 + 1e-9
    assert done.compared == before.sum()
    assert np.array_equal(was.P[before], would_be.P[before])
    at = was.inverters.index("inv4")
    apart = np.abs(was.P_set - would_be.P_set)[was.t > 1.2].max(axis=0)
    assert apart.argmax() == at
    assert apart[at] > 1000.0  # W


def test_other_gains_and_another_law_decide_otherwise(run_of: Callable[[str], Result]) -> None:
    """Each from its time on, from the set-points of that time: none jumps by more than the law's step."""
    run = run_of("islanding")

    slow = gp.counterfactual(run, replace={"gains.k_p": 0.01}, since=1.0)
    other = gp.counterfactual(run, law="dapi")

    assert slow.difference is None
    head = (slow.folder / "scenario.toml").read_text().splitlines()[:3]
    assert head[1].startswith("# Law, gains and graph hold from the start here; in what would have been, from 1 s on.")
    assert head[2].startswith("# Not in this file: delays and losses on the wire, and what people did")
    changed = np.abs(np.diff(slow.would_be.record.P_set, axis=0)).max(axis=1)
    as_it_was = np.abs(np.diff(run.record.P_set, axis=0)).max(axis=1)
    assert changed[run.record.t[1:] > 1.05].max() < as_it_was[run.record.t[1:] > 1.05].max()
    assert other.would_be.sha256 != run.sha256
    assert other.would_be.spec.cases["IV"].law == "dapi"


def test_states_that_the_record_lacks_reach_the_neighbours() -> None:
    """A law that saved messages is replaced: what it did not send is sent now; without a change it saves the same."""
    scenario = gp.Scenario(
        name="quiet", time={"end_s": 1.2}, event=[ISLANDING], law="event-triggered", case={"IV": ALL}
    )
    run = scenario.run("IV", driver="processes", clock="wall", processes=3)

    same, talks = gp.counterfactual(run), gp.counterfactual(run, law="consensus")

    assert run.metrics["messages_saved"].item() > 0.05
    assert same.would_be.sha256 == run.sha256
    assert same.would_be.metrics["messages_saved"].item() == run.metrics["messages_saved"].item()
    assert "messages_saved" not in talks.would_be.metrics
    assert talks.would_be.sha256 != run.sha256


def test_the_command_names_the_first_difference(run_of: Callable[[str], Result], tmp_path: Path) -> None:
    """A record whose scenario says other gains than the agents had is told with agent, time, quantity and values."""
    run = run_of("islanding")
    code, text = invoke("replay", str(run.folder / "IV"))

    assert code == 0, text
    assert "The replay gives what was recorded, within 1e-9." in text

    record = RunRecord.open(run.folder / "IV")
    agents = [with_gain(agent) if agent.name == "inv4" else agent for agent in record.info.agents]
    record.info = replaced(record.info, agents=tuple(agents))
    found = replay(record).difference
    assert found is not None
    assert (found.name, found.quantity, found.unit) == ("inv4", "P_set", "W")
    assert 0.5 <= found.t < 1.0
    assert str(found).startswith(f"inv4 at t = {found.t:.2f} s: P_set is ")


def test_a_record_that_was_cut_off_is_replayed_up_to_there(tmp_path: Path) -> None:
    """Kill -9 of the command: all that is in the record is the same, and a change from 0.3 s on has its effect."""
    left = killed(tmp_path / "run", "wall", 2.0)

    done = gp.replay(left.record)
    changed = gp.counterfactual(left.record, without="inv1 <-> inv4", since=0.3)

    assert done.difference is None
    assert done.parts[0].t_end > left.record.t_end - 0.5
    assert changed.difference is None
    assert changed.compared > 20


def test_who_was_stopped_from_outside_leaves_again(desk: Desk) -> None:
    """Ctrl-C of an agent is a call of its node that its journal has: in the replay too, it sends no state after it."""
    plant = desk.open_bare(
        "plant", "calm.toml", "--run", "lab", "--listen", desk.options[-1], "--wait", "20", "--out", "out"
    )
    others = desk.open("agent", *(f"inv{k}" for k in range(1, 10) if k != 2))
    alone = desk.open("agent", "inv2")
    plant.expect("t = 0; speed")
    alone.expect("joins at")
    alone.signal(signal.SIGINT)
    plant.expect("inv2 left")
    desk.type("down")
    assert (alone.end(), others.end(), plant.end()) == (130, 0, 0)

    record = RunRecord.open(desk.folder / "out")
    assert "leave" in {entry.kind for entry in record.entries("inv2") if isinstance(entry, ProcessEvent)}
    done = gp.replay(record)
    assert done.difference is None
    assert {part.name for part in done.parts} == {"plant", *(f"inv{k}" for k in range(1, 10))}


def test_a_link_that_people_cut_stays_cut_unless_commands_are_left_out(desk: Desk) -> None:
    """No key of a scenario undoes a link command, which a note tells; without link commands the messages pass."""
    plant = desk.open_bare(
        "plant", "calm.toml", "--run", "lab", "--listen", desk.options[-1], "--wait", "20", "--out", "out"
    )
    agents = desk.open("agent", *(f"inv{k}" for k in range(1, 10)))
    plant.expect("t = 0; speed")
    assert desk.type("link", "cut", "inv4", "inv7")[0] == 0
    plant.expect("link command 1")
    assert desk.type("link", "show")[0] == 0
    desk.type("down")
    assert (agents.end(), plant.end()) == (0, 0)

    record = RunRecord.open(desk.folder / "out")
    stays = gp.counterfactual(record, replace={"link": []})
    passes = gp.counterfactual(record, without_link_commands=True)

    (note,) = stays.notes
    assert "the change made no difference" in note
    assert "link commands of people, the first from t = " in note
    assert stays.would_be.links["fate"].eq("cut").any()
    assert passes.difference is None
    assert not passes.would_be.links["fate"].eq("cut").any()
    assert "link command 1" not in (passes.folder / "IV" / "events.csv").read_text()


def with_gain(agent: Any) -> Any:
    """Return a configuration with another gain."""
    gains = replaced(agent.control.gains, k_p=2.0 * agent.control.gains.k_p)
    return replaced(agent, control=replaced(agent.control, gains=gains))
