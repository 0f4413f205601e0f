"""Runs with agents that lie: the same bytes by both drivers, and a record from which decisions come again."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from gridpeers.lab.explanation.explanation import explain
from gridpeers.lab.replay.recomputation import recomputed
from tests.conformance.test_links import run
from tests.record.recorded_runs import recorded_run

LIARS = """
seed = 7
[time]
end_s = 1.4
[[event]]
label = "event1"
t_s = 0.1
open = ["13-152"]
[case.lies]
secondary = "all"
graph = "full"
[[link]]
on = "* -> inv2"
delay = 0.03
loss = 0.1
[[node]]
name = "inv3"
from_s = 0.4
to_s = 0.9
lies = { model = "replay", delay_s = 0.2 }
[[node]]
name = "inv4"
from_s = 0.3
lies = { model = "freeze", of = ["P_set"] }
[[node]]
name = "inv5"
from_s = 0.5
lies = { model = "random", P_set_W = 1e5, Q_var = 1e5, two_faced = true }
[[node]]
name = "inv6"
from_s = 0.5
lies = { model = "scale", Q = 2.0, P_set = 0.9, in_name_of = "inv1" }
[[node]]
name = "inv7"
from_s = 0.8
lies = { model = "offset", P_set_W = -1e5, plant = true }
[[node]]
name = "inv8"
from_s = 1.0
to_s = 1.1
lies = { model = "extreme", side = "alternate" }
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "liars.toml"
    path.write_text(LIARS, encoding="utf-8")
    return path


def test_lies_act_alike_in_one_process_and_in_many(scenario: Path) -> None:
    """Histories, verdicts of links and events are the same with every kind of lie; the truth has another history."""
    alone, together = run(scenario, processes=False), run(scenario, processes=True)
    scenario.write_text(LIARS[: LIARS.index("[[node]]")], encoding="utf-8")
    truth = run(scenario, processes=False)

    assert together.rows == alone.rows
    assert together.links.sha256 == alone.links.sha256
    assert together.links.counts == alone.links.counts
    lies = Counter[str]()
    for (src, _), counts in alone.links.counts.items():
        lies[src] += counts.lies
    assert lies["inv8"] == 5 * 8  # the five ticks of its 0.1 s, to each other agent
    assert lies["inv3"] == 25 * 8
    assert set(+lies) == {"inv1", "inv3", "inv4", "inv5", "inv7", "inv8"}
    assert not any(counts.lies for counts in truth.links.counts.values())
    assert together.outcome.events == alone.outcome.events
    assert truth.rows != alone.rows
    assert truth.rows[20:30] == alone.rows[20:30]  # before 0.3 s
    told = [(event.t, event.subject) for event in alone.outcome.events if " lie" in event.text or "truth" in event.text]
    times = {"inv3": (0.4, 0.9), "inv4": (0.3,), "inv5": (0.5,), "inv6": (0.5,), "inv7": (0.8,), "inv8": (1.0, 1.1)}
    assert sorted(told) == sorted((t, name) for name, of in times.items() for t in of)


def test_a_record_has_the_received_lies(scenario: Path, tmp_path: Path) -> None:
    """The record gives the decisions again to the last bit, and `why` names the liar and the lie."""
    record = recorded_run(scenario, "lies", tmp_path / "run")

    for agent in ("inv1", "inv2", "inv6", "inv8"):
        again = list(recomputed(record, agent))
        assert len(again) == 70
        assert [each.decision.tick for each in again if not each.agrees] == []
    whys = {each.name: each.why for each in explain(record, "inv9", 1.05).neighbours}
    assert whys["inv1"] == "inv6 lies: scale, P_set 0.9, Q 2, in the name of inv1"
    assert whys["inv4"] == "lies: freeze, of P_set"
    assert whys["inv8"] == "lies: extreme, side alternate"
    assert whys["inv2"] == ""
