"""Actions of a page as entries of a scenario: each is read as one, and says what was done."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.scenario_model import LoadChange, ScenarioModel
from gridpeers.viewer.page_actions import PageAction, scenario_form
from tests.scenario_files import written

SCENARIO = """
[time]
end_s = 2.0
[case.IV]
secondary = "all"
graph = "full"
"""


def of_event(scenario: ScenarioModel, key: str) -> Any:
    """A key of the one event of a scenario."""
    (event,) = scenario.events
    return getattr(event, key)


@pytest.mark.parametrize(
    ("action", "key", "value"),
    [
        (PageAction(kind="open", subject="13-152"), "open", ("13-152",)),
        (PageAction(kind="close", subject="18-135"), "close", ("18-135",)),
        (PageAction(kind="synchronise", subject="18-135"), "synchronised", True),
        (PageAction(kind="stop", subject="inv4"), "leave", ("inv4",)),
        (PageAction(kind="start", subject="inv10"), "join", ("inv10",)),
        (PageAction(kind="load", subject="48", factor=1.5), "load", {"48": LoadChange(factor=1.5)}),
        (PageAction(kind="load", subject="48", P_kW=300, Q_kvar=-9), "load", {"48": LoadChange(P_kW=300, Q_kvar=-9)}),
    ],
)
def test_an_event_of_the_page_is_one_of_a_scenario(action: PageAction, key: str, value: Any, tmp_path: Path) -> None:
    """With a label and a time it loads, and has what was clicked."""
    entry = scenario_form(action).replace("[[event]]", '[[event]]\nlabel = "mine"\nt_s = 1.0')

    assert of_event(load_scenario(written(tmp_path, SCENARIO + entry))[0], key) == value


@pytest.mark.parametrize(
    ("action", "kinds"),
    [
        (PageAction(kind="cut", subject="inv1", other="inv4"), {"cut"}),
        (PageAction(kind="delay", subject="inv1", other="inv4", value=0.1), {"delay"}),
        (PageAction(kind="loss", subject="inv1", other="inv4", value=0.25), {"loss"}),
    ],
)
def test_a_fault_of_the_page_is_one_of_a_scenario(action: PageAction, kinds: set[str], tmp_path: Path) -> None:
    """A link that is cut, or late, or loses messages, both ways."""
    scenario, _ = load_scenario(written(tmp_path, SCENARIO + scenario_form(action)))

    (fault,) = scenario.netem.links
    assert fault.on == "inv1 <-> inv4"
    assert set(fault.models()) == kinds


def test_what_ends_another_entry_has_none() -> None:
    """To heal a link is the end of the entry that cuts it."""
    assert scenario_form(PageAction(kind="heal", subject="inv1", other="inv4")) == ""
