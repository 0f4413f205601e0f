"""Records of simulated runs of which a chunk is damaged: what is not known is told, and nothing is invented."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader

from gridpeers.lab.replay.replay import replay
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from tests.record.recorded_runs import recorded_in_chunks

FAULTS = """
[time]
end_s = 4.0
[[event]]
label = "event1"
t_s = 1.0
open = ["13-152"]
[case.IV]
secondary = "all"
graph = "full"
[[case.IV.link]]
on = "* <-> *"
loss = 0.2
"""


@pytest.fixture(scope="module")
def damaged(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunRecord, RunRecord]:
    """A record, and the same with one bit of a chunk in its middle flipped."""
    folder = tmp_path_factory.mktemp("damaged")
    whole = recorded_in_chunks(FAULTS, folder, "IV", chunk=40_000)
    return whole, with_damage(whole, folder)


def with_damage(whole: RunRecord, folder: Path) -> RunRecord:
    """The same record with one bit of a chunk in its middle flipped."""
    with whole.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunks = summary.chunk_indexes
    assert len(chunks) > 4
    middle = chunks[len(chunks) // 2]
    data = bytearray(whole.path.read_bytes())
    data[middle.chunk_start_offset + middle.chunk_length // 2] ^= 1
    other = folder / "flipped.mcap"
    other.write_bytes(data)
    return RunRecord.open(other)


def test_what_a_damaged_chunk_held_is_not_invented(damaged: tuple[RunRecord, RunRecord]) -> None:
    """Every decision that is still told is told as in the whole record; of the others it is said that they lack."""
    whole, flipped = damaged

    told = {decision.tick: decision for decision in flipped.decisions("inv4")}
    holes = flipped.holes("inv4")
    missing = [decision for decision in whole.decisions("inv4") if decision.tick not in told]

    assert whole.holes("inv4") == []
    assert holes
    assert len(told) > 20
    for decision in whole.decisions("inv4"):
        if decision.tick in told:
            there = {each.name for each in told[decision.tick].neighbours if each.state is not None}
            known = [each if each.name in there else replace(each, state=None) for each in decision.neighbours]
            assert told[decision.tick] == replace(decision, neighbours=tuple(known))
    assert missing
    assert sum(decision.is_whole for decision in told.values()) > 20
    inside = next(each for each in missing if any(a < each.t <= b for a, b in holes))
    with pytest.raises(RecordFileError, match=r"lacks how inv4 decided at t = .* a chunk is damaged"):
        flipped.decision("inv4", inside.t)


def test_a_replay_ends_at_the_hole_and_says_so(damaged: tuple[RunRecord, RunRecord]) -> None:
    """No difference is claimed of what is not known; the note says that not all was compared."""
    whole, flipped = damaged

    found = replay(flipped)

    assert found.difference is None
    assert any("lacks later decisions" in note for note in found.notes)
    assert replay(whole).notes == ()
    counts = {part.name: part.count for part in found.parts}
    all_ = {part.name: part.count for part in replay(whole).parts}
    assert 0 < counts["inv4"] < all_["inv4"]
