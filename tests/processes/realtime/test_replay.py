"""Replay of runs in real time: the same cores decide the same, and a counterfactual follows from them."""

from __future__ import annotations

import signal

import pytest

import gridpeers as gp
from gridpeers.runs.result import Result
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.journal import ProcessEvent
from tests.processes.terminals import Desk

AGENTS = {"inv1", "inv2", "inv4", "inv7"}
OTHERS = ["inv3", "inv5", "inv6", "inv8", "inv9"]


@pytest.fixture(scope="module")
def run() -> Result:
    """A run of four agents in which one leaves and returns, and a fifth of the messages is lost."""
    scenario = gp.Scenario(
        name="plug-n-play",
        seed=7,
        time={"end_s": 2.6},
        plant={"load_set": "main"},
        event=[
            {"label": "islanding", "t_s": 0.5, "open": ["13-152"]},
            {"label": "leave", "t_s": 0.8, "leave": ["inv2"]},
            {"label": "return", "t_s": 1.2, "join": ["inv2"]},
        ],
        case={
            "IV": {
                "secondary": "all",
                "graph": "full",
                "without_agent": OTHERS,
                "link": [{"on": "* <-> *", "loss": 0.2}],
            }
        },
    )
    return scenario.run("IV", driver="processes", clock="realtime")


def test_a_replay_gives_the_set_points_of_the_run(run: Result) -> None:
    """Every state of every process, and every row of the plant, is the same within 1e-9."""
    done = gp.replay(run)

    assert (done.difference, done.notes) == (None, ())
    plant, *agents = done.parts
    assert plant.count == len(run.history)
    assert {part.name for part in agents} == AGENTS
    assert len(agents) == 5  # a process of its own for who returns
    assert min(part.count for part in agents) > 0
    assert max(part.t_end for part in agents) > run.spec.time.end_s - 0.5


def test_a_loop_without_a_change_gives_the_run_back(run: Result) -> None:
    """Each process hears what the others send in the replay. The replay needs only the times of the record."""
    done = gp.counterfactual(run)

    assert done.difference is None
    assert done.compared == len(run.history)
    assert done.would_be.sha256 == run.sha256
    assert done.table["difference"].abs().max() == 0.0
    assert done.would_be.events.equals(done.was.events)


def test_who_was_stopped_from_outside_leaves_again(desk: Desk) -> None:
    """Ctrl-C of an agent is a call of its node that its journal has: in the replay too, it sends no state after it."""
    plant = desk.open_bare(
        "plant", "calm.toml", "--run", "lab", "--listen", desk.options[-1], "--wait", "0", "--out", "out"
    )
    others = desk.open("agent", "inv1", "inv4")
    alone = desk.open("agent", "inv2")
    plant.expect("t = 0; speed")
    alone.expect("joins at")
    others.expect("inv4: joins at")
    alone.signal(signal.SIGINT)
    plant.expect("inv2 left")
    desk.type("down")
    assert (alone.end(), others.end(), plant.end()) == (130, 0, 0)

    record = RunRecord.open(desk.folder / "out")
    assert "leave" in {entry.kind for entry in record.entries("inv2") if isinstance(entry, ProcessEvent)}
    done = gp.replay(record)
    assert done.difference is None
    assert {part.name for part in done.parts} == {"plant", "inv1", "inv2", "inv4"}
