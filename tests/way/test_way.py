"""The way of a value from a measurement to a set-point is short, and docs/architecture.md shows all of it."""

from __future__ import annotations

from tests.way.way import PAGE, files_of, page_with, table, way

LIMITS = {"measurement": (14, 25), "to the neighbour": (13, 25), "to the plant": (10, 13)}
"""Most files and most calls of each leg."""


def test_the_way_of_a_value_is_within_its_limits_and_on_the_page() -> None:
    """Whoever shortens it lowers the limit; python -m tests.way.way --write puts it on the page."""
    legs = way()

    counted = {leg: (len(files_of(found)), len(found)) for leg, found in legs.items()}
    assert all(files <= LIMITS[leg][0] and calls <= LIMITS[leg][1] for leg, (files, calls) in counted.items()), counted
    assert page_with(table(legs)) == PAGE.read_text()
