"""The phases of a node."""

from __future__ import annotations

import pytest

from gridpeers.wire.phases import PhaseError, Phases, diagram

TABLE = {
    "meeting": {"all here": "running", "end": "over"},
    "running": {"tick": "running", "end": "over", "fault": "over"},
    "over": {},
}


def test_only_an_event_of_the_table_changes_the_phase() -> None:
    """The error names the phase, the event, and the events that may happen."""
    phases = Phases(TABLE)
    phases.on("all here")
    assert (phases.now, phases.allows("tick"), phases.allows("all here")) == ("running", True, False)

    with pytest.raises(PhaseError, match=r'no event "all here" may happen in phase "running"; .*: tick, end, fault'):
        phases.on("all here")
    assert phases.now == "running"


def test_the_diagram_has_every_transition() -> None:
    """Events between the same two phases share an arrow; a phase without events is the end."""
    assert diagram(TABLE).splitlines() == [
        "stateDiagram-v2",
        "    [*] --> meeting",
        "    meeting --> running: all here",
        "    meeting --> over: end",
        "    running --> running: tick",
        "    running --> over: end, fault",
        "    over --> [*]",
    ]
