"""Liars of a scenario: what `check` tells of them, and what certificates rule out."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.scenarios.schema import ScenarioError, load_scenario
from gridpeers.scenarios.schema.check_notes import liar_notes

LIARS = """
[time]
end_s = 2.0
[case.I]
secondary = "all"
graph = "full"
[case.II]
secondary = "all"
graph = "full"
[[case.II.node]]
name = "inv2"
to_s = 1.5
lies = { model = "freeze", in_name_of = "inv5", plant = true }
[[node]]
name = "inv3"
from_s = 1.0
lies = { model = "offset", P_set_W = 1e5 }
"""


def test_check_lists_each_liar_with_its_time_its_lie_and_its_cases(tmp_path: Path) -> None:
    """A sentence for each, with the cases if it does not lie in all."""
    (tmp_path / "liars.toml").write_text(LIARS, encoding="utf-8")
    scenario, feeder = load_scenario(tmp_path / "liars.toml")

    assert list(liar_notes(scenario, feeder)) == [
        "inv3 lies from 1 s to the end: offset, P_set_W 100000",
        "inv2 lies from 0 s to 1.5 s: freeze, in the name of inv5, to the plant too (in II)",
    ]


def test_check_says_of_a_lie_for_an_agent_that_is_away_that_nobody_hears_it(tmp_path: Path) -> None:
    """It has left before; an agent that returns meanwhile lies."""
    away = '[[event]]\nlabel = "away"\nt_s = 0.5\nleave = ["inv3"]\n'
    back = '[[event]]\nlabel = "back"\nt_s = 1.5\njoin = ["inv3"]\n'
    told = []
    for more in (away, away + back):
        (tmp_path / "liars.toml").write_text(LIARS + more, encoding="utf-8")
        told.append([note for note in liar_notes(*load_scenario(tmp_path / "liars.toml")) if note.startswith("inv3")])
    lies = "inv3 lies from 1 s to the end: offset, P_set_W 100000"

    assert told == [
        [f"{lies}; nobody hears it, as inv3 has left at 0.5 s"],
        [lies],
    ]


def test_nobody_lies_in_anothers_name_behind_certificates(tmp_path: Path) -> None:
    """With `security = "mtls"` such an entry is a problem at its key."""
    (tmp_path / "liars.toml").write_text('security = "mtls"\n' + LIARS, encoding="utf-8")

    with pytest.raises(ScenarioError, match=r"case\.II\.node\[0\]\.lies\.in_name_of: certificates keep it out"):
        load_scenario(tmp_path / "liars.toml")
