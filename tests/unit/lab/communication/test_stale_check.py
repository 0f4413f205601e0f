"""Values that are too old when they are used."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest

from gridpeers.scenarios.checks.checked_case import CheckedCase
from tests.unit.scenarios.checks.cases import ran_with, verdict, with_content


def test_a_stale_value_is_caught(sound: CheckedCase) -> None:
    """A value of 0.4 s where 0.25 s is the limit, with who used it and when."""
    content = sound.content
    epoch, entry = content.decisions["inv3"][-1]
    late = msgspec.structs.replace(entry, tick=200, states=[20, *entry.states[1:]])
    decisions = dict(content.decisions) | {"inv3": [*content.decisions["inv3"], (epoch, late)]}
    old = with_content(sound, replace(content, decisions=decisions))
    found = verdict(old, "stale_values")

    assert (found.count, found.violations[0].agent, found.violations[0].unit) == (1, "inv3", "s")
    assert (found.violations[0].value, found.violations[0].limit) == (pytest.approx(0.4), 0.25)
    assert found.violations[0].t == pytest.approx(4.0)
    assert verdict(old, "stale_values", max_age_s=0.5).status == "passed"


def test_a_cut_that_holds_the_last_state_makes_it_stale() -> None:
    """The paper's law holds what it heard last: after a cut of half a second that is too old."""
    changes = (("case.IV.link", repr([{"on": "inv2 -> inv1", "cut": True, "from_s": 2.0, "to_s": 2.5}])),)
    found = verdict(ran_with((*changes, ("time.end_s", "5.0"))).checked_case, "stale_values")

    assert (found.count, found.violations[0].agent) == (1, "inv1")
    assert found.violations[0].value == pytest.approx(0.5, abs=0.05)
