"""Real time with real processes: people start, stop, kill and freeze agents and the plant. The plant is a toy.

Every wait is for a message, with a deadline.
"""

from __future__ import annotations

import signal
from itertools import pairwise
from pathlib import Path

import pytest

from gridpeers.agents.agent_config import MAX_AGE
from tests.toy.town import Town

FOUR = ("inv1", "inv2", "inv3", "inv4")
OTHERS = ("inv1", "inv3", "inv4")


def P_sets(row: tuple[float, ...]) -> list[float]:
    """P_set (W) of all inverters in a row."""
    return list(row[5::6])


def P_outs(row: tuple[float, ...]) -> list[float]:
    """P (W) of all inverters in a row."""
    return list(row[2::6])


def largest_step(rows: list[tuple[float, ...]], inverters: tuple[int, ...]) -> float:
    """Largest change of P_set (W) of some inverters from one row to the next."""
    return max(abs(P_sets(b)[i - 1] - P_sets(a)[i - 1]) for a, b in pairwise(rows) for i in inverters)


def settled(town: Town, of: tuple[int, ...] = (1, 2, 3)) -> Town:
    """Wait for telemetry, from now on, of an island at 60 Hz in which these inverters share equally."""
    since = len(town.rows)

    def at_rest() -> bool:
        if len(town.rows) == since or town.rows[-1][0] < 0.5:
            return False
        row = town.rows[-1]
        shares = [P_sets(row)[i - 1] for i in of]
        return abs(row[1] - 60.0) < 0.0003 and max(shares) - min(shares) < 50.0

    return town.until(at_rest, "60 Hz and equal set-points")


def test_a_frozen_agent_and_a_killed_one_are_out_and_in_again(tmp_path: Path) -> None:
    """SIGSTOP: neighbours drop it by age, long before its token is gone; SIGCONT: all use each other again.

    Kill -9: reported, out of all sums, its inverter held; a new process of the name is welcome.
    """
    with Town(4, tmp_path).all() as town:
        settled(town)
        too_old: set[str] = set()

        def left_out() -> bool:
            """Note who leaves inv2 out, which still counts as present, because its last state is too old."""
            for name in OTHERS:
                status = town.status[name]
                ages = dict(zip(status.neighbours, status.ages, strict=True))
                if "inv2" not in status.used and ages.get("inv2", 0.0) > MAX_AGE:
                    too_old.add(name)
            return len(too_old) == len(OTHERS)

        town.signal("inv2", signal.SIGSTOP)
        town.until(left_out, "all leave inv2 out for its age, while its token is there").together(OTHERS)
        before = len(town.rows)
        town.until(lambda: not any("/inv2/" in key for key in town.tokens), "its token is gone")
        town.signal("inv2", signal.SIGCONT)
        town.together(FOUR)
        settled(town)

        assert largest_step(town.rows[before:], (1, 2, 3, 4)) < 100.0
        assert town.status["inv2"].phase == "running"

        count = len(town.events)
        town.signal("inv2", signal.SIGKILL)
        town.until_event("inv2", "inv2 died; its inverter stays on primary droop", after=count).together(OTHERS)
        first = town.status["inv2"].epoch
        before = len(town.rows)
        town.start("inv2").together(FOUR)
        settled(town)

        assert town.status["inv2"].epoch > first
        assert largest_step(town.rows[before:], (1, 3, 4)) < 100.0


def test_who_is_asked_to_leave_leaves_properly(tmp_path: Path) -> None:
    """SIGTERM and Ctrl-C: its inverter is off the network, the others take over, and its exit status is 0."""
    others = ("inv1", "inv3", "inv4", "inv5", "inv6")
    with Town(6, tmp_path).all() as town:
        settled(town, of=(1, 2, 3, 4, 5, 6))
        town.signal("inv2", signal.SIGTERM)
        assert town.until_ended("inv2") == 0
        town.until_event("inv2", "inv2 disconnected").together(others)
        taken_over = settled(town, of=(1, 3, 4, 5, 6)).rows[-1]
        town.start("inv2").until_event("inv2", "inv2 connected").together((*others, "inv2"))
        settled(town, of=(1, 2, 3, 4, 5, 6))
        count = len(town.events)
        town.signal("inv2", signal.SIGINT)
        assert town.until_ended("inv2") == 0
        town.until_event("inv2", "inv2 disconnected", after=count).together(others)

        assert P_outs(taken_over)[1] == 0.0
        assert P_outs(taken_over)[0] == pytest.approx(0.96 * 100e3, abs=300.0)
        assert [event.subject for event in town.events if "left" in event.text] == ["inv2", "inv2"]
        assert not any("died" in event.text for event in town.events)


def test_agents_of_one_process_live_and_leave_as_others_do(tmp_path: Path) -> None:
    """Two agents behind one session tick, are asked to leave one by one, and leave together on SIGTERM."""
    with Town(4, tmp_path) as town:
        town.start("plant", "inv1", "inv4")
        pair = town.add("pair", ["-m", "gridpeers.agents"], (town.agent_configs["inv2"], town.agent_configs["inv3"]))
        town.together(FOUR)
        settled(town)
        town.command("stop", "inv2")
        town.until_event("inv2", "inv2 disconnected").together(("inv1", "inv3", "inv4"))
        town.until(lambda: not any("/inv2/" in key for key in town.tokens), "its token is gone")

        assert pair.status is None
        town.signal("pair", signal.SIGTERM)
        assert town.until_ended("pair") == 0
        town.until_event("inv3", "inv3 disconnected").together(("inv1", "inv4"))
        assert not any("died" in event.text for event in town.events)


def test_a_plant_that_freezes_or_dies_is_held_out_for_and_has_its_agents_again(tmp_path: Path) -> None:
    """SIGSTOP: agents hold. SIGCONT: the plant does not rush through the missed time, and says how long it was.

    Kill -9 of the plant, which is the rendezvous too: agents hold and look for it. They all join a new plant.
    """
    with Town(4, tmp_path).all() as town:
        settled(town)
        town.signal("plant", signal.SIGSTOP)
        town.until(lambda: all(town.status[name].phase == "seeking" for name in FOUR), "all seek")
        town.signal("plant", signal.SIGCONT)
        # not the event: with the link silent for longer than the lease, its one message may be lost on the way here
        town.until(town.was_put_off, "the plant says by how much")
        town.together(FOUR)
        settled(town)

        assert town.telemetry is not None
        assert town.telemetry.pacing is not None
        assert town.telemetry.pacing.slipped > 1.0
        assert "s of real time behind; all later steps are delayed" in town.children["plant"].log.read_text()

        town.signal("plant", signal.SIGKILL)
        town.until(lambda: all(town.status[name].phase == "seeking" for name in FOUR), "all seek")
        held = {name: town.status[name].sent for name in FOUR}
        town.until(lambda: all(town.status[name].received > 0 for name in FOUR), "news")
        assert all(town.children[name].status is None for name in FOUR)
        assert {name: town.status[name].sent for name in FOUR} == held
        town.events.clear()
        town.rows.clear()
        town.start("plant").together(FOUR)
        town.until_event("inv4", "inv4 joined")

        settled(town)
