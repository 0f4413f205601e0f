"""The phases of an agent: one table for both kinds of time, shown in docs/architecture.md."""

from __future__ import annotations

from pathlib import Path

from gridpeers.agents.agent_node import AGENT_PHASES
from gridpeers.wire.phases import diagram

PAGE = Path(__file__).parents[3] / "docs" / "architecture.md"


def test_the_page_shows_all_phases_and_the_way_out_of_each() -> None:
    """An agent can end in any phase, and stays ended."""
    assert diagram(AGENT_PHASES) in PAGE.read_text(encoding="utf-8")
    assert [phase for phase, events in AGENT_PHASES.items() if "end" not in events] == ["over"]
    assert not AGENT_PHASES["over"]
