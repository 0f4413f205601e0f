"""What is plugged in by an installed distribution is found by its entry point; defaults of a user's class."""

from collections.abc import Iterator
from importlib import metadata
from typing import Annotated

import pytest

from gridpeers.agents.graphs import GRAPHS, ring
from gridpeers.wire.plugins import registry
from gridpeers.wire.plugins.plugin import Plugin, callable_objection, made, plugin_problems
from gridpeers.wire.schema.table_schema import Plausible, Range


@pytest.fixture
def entry_points(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    points = (
        metadata.EntryPoint("round", "gridpeers.agents.graphs:ring", "gridpeers.graphs"),
        metadata.EntryPoint("broken", "gridpeers.agents.graphs:nowhere", "gridpeers.graphs"),
    )
    monkeypatch.setattr(metadata, "entry_points", lambda group: points if group == GRAPHS.group else ())
    registry.entry_points_of.cache_clear()
    yield
    registry.entry_points_of.cache_clear()


def test_an_entry_point_adds_to_a_registry(entry_points: None) -> None:
    """Its name is listed after those of gridpeers, and leads to the object."""
    assert GRAPHS.names[:6] == ("full", "none", "GFM-only", "clustered", "ring", "links")
    assert GRAPHS.names[-2:] == ("round", "broken")
    assert made(GRAPHS, Plugin(use="round")) is ring


def test_an_entry_point_that_leads_nowhere_is_told_where_it_is_used_and_listed(entry_points: None) -> None:
    """One line; the page of what there is still prints."""
    from gridpeers.scenarios.reference import page

    ((_, said),) = plugin_problems(GRAPHS, Plugin(use="broken"))

    assert said.startswith('gridpeers.agents.graphs:nowhere: module gridpeers.agents.graphs has no "nowhere"')
    assert "Cannot be used: gridpeers.agents.graphs:nowhere" in page("graphs")


def test_a_default_may_be_anything_of_its_type() -> None:
    """None is accepted if the type has it, because no file can write it. A value of another type is refused."""

    class Star:
        hub: str | None = None
        reach: float | None = None
        most: Annotated[float | None, Range(0, 10)] = None
        delay_s: Annotated[float | None, Plausible("a delay", 0, 10)] = None

        def __call__(self, members: object) -> dict[str, set[str]]:
            return {}

    assert callable_objection(Star, "members") == ""

    class Far(Star):
        reach = "far"  # type: ignore[assignment]

    assert callable_objection(Far, "members") == 'Far.reach: its default must be a number, got "far"'
