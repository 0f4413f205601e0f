"""The faults of links under changes."""

from __future__ import annotations

from math import inf

import pytest
from msgspec.structs import replace

from gridpeers.lab.replay.changes import lossless, spliced, without_loss
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.partition import Partition
from gridpeers.wire.plugins.plugin import plugin_of

EARLY = Fault(on="* -> inv1", delay=0.1, to_s=2.0)
LONG = Fault(on="* -> inv2", delay=0.1)
LATE = Fault(on="* -> inv3", delay=0.1, from_s=4.0, to_s=6.0)
ENDED = Fault(on="* -> inv4", delay=0.1, from_s=0.5, to_s=1.0)
HALVES = Partition(by="halves", from_s=1.0, to_s=5.0)


def in_force(netem: Netem, t: float) -> set[object]:
    """What holds at a time (s), whatever its own times are."""
    return {
        (entry.on, str(entry.delay)) if isinstance(entry, Fault) else entry.by
        for entry in (*netem.links, *netem.partitions)
        if entry.from_s <= t < (inf if entry.to_s is None else entry.to_s)
    }


@pytest.mark.parametrize("since", [0.0, 0.7, 1.5, 3.0, 4.0, 5.5, 8.0])
def test_each_time_has_the_faults_of_its_configuration(since: float) -> None:
    """Up to the change those of the one, from then on those of the other, at every time."""
    one = Netem(links=(EARLY, LONG, LATE, ENDED), partitions=(HALVES,))
    other = Netem(
        links=(LONG, Fault(on="* -> inv1", delay=0.3), Fault(on="inv5 -> inv6", loss=1.0, from_s=2.0, to_s=3.5))
    )

    for before, after in ((one, other), (other, one)):
        both = spliced(before, after, since)
        for entry in (*both.links, *both.partitions):
            assert entry.to_s is None or entry.from_s < entry.to_s
        for t in (0.0, 0.2, 0.6, 0.8, 1.2, 1.8, 2.2, 2.9, 3.2, 3.8, 4.5, 5.2, 5.8, 7.0, 9.0):
            assert in_force(both, t) == in_force(before if t < since else after, t), t


def test_an_entry_of_both_stays_whole() -> None:
    """So its random numbers are those of the record."""
    both = spliced(Netem(links=(EARLY, LONG)), Netem(links=(LONG,)), 1.0)

    assert both.links == (LONG, Fault(on="* -> inv1", delay=0.1, to_s=1.0))


def test_without_loss_all_else_of_a_fault_is_left() -> None:
    """A fault that was loss alone is gone; its times and its other models stay."""
    lossy = Fault(on="* -> inv1", loss=0.2, delay=0.1, from_s=1.0, to_s=2.0)

    left = lossless(lossy)

    assert left is not None
    assert (left.on, left.from_s, left.to_s) == ("* -> inv1", 1.0, 2.0)
    assert left.models() == Fault(on="* -> inv1", delay=0.1).models()
    assert lossless(EARLY) is EARLY
    own = replace(lossy, delay=None, own=(plugin_of({"use": "mine:Burst"}),))
    assert getattr(lossless(own), "own", None) == own.own
    assert without_loss(Netem(links=(Fault(on="* -> inv2", loss=0.2), lossy, EARLY))).links == (left, EARLY)
