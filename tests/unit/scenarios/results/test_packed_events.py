"""Events of a run under way are packed, and come back as they were."""

from __future__ import annotations

import tracemalloc

from hypothesis import given
from hypothesis import strategies as st

from gridpeers.scenarios.results.packed_events import PackedEvents
from gridpeers.wire.messages import PlantEvent

EVENTS = st.builds(
    PlantEvent,
    t=st.floats(0.0, 1e9),
    kind=st.sampled_from(("switch", "trip", "load", "roster")),
    subject=st.text(max_size=20),
    text=st.text(max_size=80),
    closed=st.none() | st.booleans(),
    P=st.none() | st.floats(-1e11, 1e11),
)


@given(st.lists(st.lists(EVENTS, max_size=4), max_size=6))
def test_events_come_back_as_they_were(batches: list[list[PlantEvent]]) -> None:
    """However they come, all events are there in their order at any time, bit for bit."""
    packed, added = PackedEvents(), []
    for batch in batches:
        packed.extend(batch)
        added += batch
        assert [repr(event) for event in packed] == [repr(event) for event in added]


def test_many_events_take_little_memory() -> None:
    """An hour in which agents come and go all the time takes a twentieth of the objects' memory."""
    packed = PackedEvents()
    tracemalloc.start()
    try:
        for i in range(5000):
            name = f"inv{i * 7919 % 10}"
            packed.extend([PlantEvent(t=0.53 * i, kind="roster", subject=name, text=f"{name} left: number {i * i}")])
        assert tracemalloc.get_traced_memory()[0] < 5000 * 30
    finally:
        tracemalloc.stop()
