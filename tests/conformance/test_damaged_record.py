"""Records of simulated runs of which a chunk is damaged: what is not known is told, and nothing is invented."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from mcap.reader import make_reader

from gridpeers.lab.communication.record_content import read_content
from gridpeers.lab.replay.replay import replay
from gridpeers.scenarios.record.decision_entries import inside
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.viewer.record_view import RecordView
from tests.record.fake_clock import fake_clock_record
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


def test_the_page_draws_no_link_of_a_decision_that_is_lost(damaged: tuple[RunRecord, RunRecord]) -> None:
    """Page, `why` and checks know the same decisions: where one of them says that the record lacks it, all do."""
    whole, flipped = (RunRecord.open(each.path) for each in damaged)
    shown, known = RecordView(flipped), RecordView(whole)
    content = read_content(flipped.path)
    checked = {state.number for state in content.of_agent("inv4") if not inside(content.holes["inv4"], state.t)}
    told = {decision.tick: decision for decision in flipped.decisions("inv4")}
    drawn = []
    edges = [round(t / 0.02) for hole in flipped.holes("inv4") for t in hole if t < 4.0]
    ticks = sorted({*range(1, 200, 11), *(edge + k for edge in edges for k in (-1, 0, 1, 2))})
    for tick in ticks:
        t = tick * 0.02
        frame = shown.frame(t)
        (row,) = (one for one in frame.inverters if one.name == "inv4")
        if tick in told:
            links = [(link.src, link.state, link.age) for link in frame.links["inv4"]]
            assert links == [(link.src, link.state, link.age) for link in known.frame(t).links["inv4"]]
            assert all(link.rate > 20.0 for link in frame.links["inv4"] if tick > 60)
            assert row.hears is not None
            drawn.append(tick)
        else:
            assert frame.links["inv4"] == ()
            assert (row.hears, row.ages) == (None, {})
            assert row.note == "how it decided is not known: the record is damaged there"
            with pytest.raises(RecordFileError, match="lacks how inv4 decided"):
                shown.decision("inv4", t)

    checked &= set(ticks)
    assert checked >= set(drawn)
    assert len(checked - set(drawn)) <= 1, "which has no set-points before it; no check needs them"
    assert 8 < len(drawn) < len(ticks)


def test_in_real_time_each_decision_tells_all_and_the_lost_ones_are_missed(tmp_path: Path) -> None:
    """Page and `why` agree at each period; a decision is in force for one, and not until the next that is there."""
    whole = fake_clock_record(tmp_path / "case", end=3.0)
    flipped = with_damage(whole, tmp_path)
    shown, lacking = RecordView(flipped), 0
    for k in range(5, 150, 3):
        t = 0.02 * k
        frame, decision = shown.frame(t), whole.decision("inv2", t)
        (row,) = (one for one in frame.inverters if one.name == "inv2")
        try:
            assert flipped.decision("inv2", t).tick == decision.tick
            assert (row.hears, row.note, len(frame.links["inv2"])) == (2, "", 2)
        except RecordFileError:
            lacking += 1
            assert (row.hears, frame.links["inv2"]) == (None, ())
            assert row.note == "how it decided is not known: the record is damaged there"

    assert 3 < lacking < 40
