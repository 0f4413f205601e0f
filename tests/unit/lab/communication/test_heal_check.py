"""The check that agents use each other's values again once a cut between them has healed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import pytest

import gridpeers as gp
from gridpeers.scenarios.checks.checked_case import CheckedCase
from tests.unit.lab.communication.records import CUT
from tests.unit.scenarios.checks.cases import ran_with, verdict, with_content


def deaf(entry: Any) -> Any:
    """A decision that leaves inv2 out, as a state that was never heard."""
    if "inv2" not in entry.neighbours:
        return entry
    at = entry.neighbours.index("inv2")
    unused = [*(entry.unused or [""] * len(entry.neighbours))]
    unused[at] = "silent"
    states = [*entry.states]
    states[at] = None
    return msgspec.structs.replace(entry, unused=unused, states=states)


def test_without_a_cut_there_is_no_heal_to_judge(sound: CheckedCase) -> None:
    """No cut, no verdict."""
    assert verdict(sound, "heal").sentence == "heal not judged: no link was cut and healed"


def test_agents_that_rejoin_after_a_cut_pass() -> None:
    """A cut of 0.16 s heals at once; before the limit's time is over the run ends, and it is judged all the same."""
    assert verdict(ran_with(CUT).checked_case, "heal").sentence == "heal passed"


def test_a_split_that_outlasts_its_heal_is_caught() -> None:
    """Agents that never use a state of inv2 after the cut are named, each."""
    case = ran_with(CUT).checked_case
    content = case.content
    decisions = {}
    for agent, entries in content.decisions.items():
        decisions[agent] = [(epoch, deaf(entry)) if entry.tick >= 100 else (epoch, entry) for epoch, entry in entries]
    found = verdict(with_content(case, replace(content, decisions=decisions)), "heal", within_s=1.0)

    assert found.count == 8
    assert all("no new value of inv2 is used after the cut ended at 2.16 s" in one.text for one in found.violations)


@pytest.mark.parametrize(("again_s", "count"), [(2.5, 0), (3.5, 1)])
def test_a_heal_is_judged_by_the_time_until_its_link_is_lost_again(again_s: float, count: int) -> None:
    """Where nothing comes through a cut's end, its link must have been whole for the limit's time to be named."""
    spans = [(1.5, 2.0), (again_s, 3.8)]
    changes = repr([{"on": "inv2 -> inv1", "cut": True, "from_s": a, "to_s": b} for a, b in spans])
    case = ran_with((("case.IV.link", changes), ("time.end_s", "4.5"))).checked_case
    content = case.content
    decisions = {
        agent: [(epoch, deaf(entry) if agent == "inv1" and entry.tick < 180 else entry) for epoch, entry in entries]
        for agent, entries in content.decisions.items()
    }
    found = verdict(with_content(case, replace(content, decisions=decisions)), "heal", within_s=1.0)

    assert [one.text for one in found.violations] == [
        "no new value of inv2 is used after the cut ended at 2 s" for _ in range(count)
    ]


@pytest.mark.parametrize(("until", "count"), [(140, 0), (170, 1)])
def test_the_longest_time_that_both_are_at_work_is_that_of_a_heal(until: int, count: int) -> None:
    """inv1 pauses again and again after a cut: it must use nothing new of inv2 for the limit's time in one piece."""
    pauses = [(2.2, 2.4), (2.5, 2.7), (until * 0.02, 3.9)]
    changes = (
        ("case.IV.link", repr([{"on": "inv2 -> inv1", "cut": True, "from_s": 1.5, "to_s": 2.1}])),
        ("case.IV.node", repr([{"name": "inv1", "pause": True, "from_s": a, "to_s": b} for a, b in pauses])),
        ("time.end_s", "4.5"),
    )
    case = ran_with(changes).checked_case
    content = case.content
    decisions = {
        agent: [(epoch, deaf(entry) if agent == "inv1" and entry.tick >= 75 else entry) for epoch, entry in entries]
        for agent, entries in content.decisions.items()
    }
    found = verdict(with_content(case, replace(content, decisions=decisions)), "heal", within_s=0.65)

    assert found.count == count


def test_a_heal_is_not_judged_while_its_receiver_is_away() -> None:
    """inv2 leaves when a cut ends and comes back into another one: neither end is held against anybody."""
    links = [
        {"on": "* <-> *", "cut": True, "from_s": 1.94, "to_s": 1.98},
        {"on": "inv6 <-> *", "cut": True, "from_s": 2.28, "to_s": 4.02},
    ]
    changes = {"case.IV.link": links, "time.end_s": 5.5}
    run = gp.load("plug-n-play").replace(changes).run("IV")  # its record goes with it
    found = verdict(run.checked_case, "heal", within_s=1.0)

    assert found.sentence == "heal passed"
