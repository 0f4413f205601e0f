"""The page of a record, without a browser: what it shows at a time is what the record has of that time."""

from __future__ import annotations

import shutil
from math import isnan
from pathlib import Path

import msgspec
import pytest

from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.shared_quantities import read_shared
from gridpeers.viewer.record_view import RecordView
from gridpeers.viewer.run_view import Frame
from tests.record.recorded_runs import recorded_in_chunks, recorded_run

ISLANDED = """
[time]
end_s = 1.6
[[event]]
label = "event1"
t_s = 0.2
open = ["13-152"]
[case.case]
secondary = "all"
graph = "full"
[[link]]
on = "inv4 <-> inv7"
cut = true
from_s = 0.5
[[link]]
on = "inv1 -> inv2"
loss = 0.5
"""
"""Nine agents that island at 0.2 s; one link is cut from 0.5 s on, another loses half of its messages."""


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    return recorded_in_chunks(ISLANDED, tmp_path_factory.mktemp("run"), chunk=60_000)


@pytest.fixture
def view(record: RunRecord) -> RecordView:
    """A view of it, that nobody has asked for anything."""
    return RecordView(RunRecord.open(record.path))


def encoded(frame: Frame) -> bytes:
    return msgspec.json.encode(frame)


def test_a_time_has_one_frame(record: RunRecord, view: RecordView) -> None:
    """Whichever times were asked for before, forwards or backwards, the page shows the same of a time."""
    times = (0.0, 0.51, 1.6, 0.3)
    frames = {t: encoded(view.frame(t)) for t in times}

    for t in times:
        assert encoded(view.frame(t)) == frames[t]
        assert encoded(RecordView(RunRecord.open(record.path)).frame(t)) == frames[t]
    assert len(set(frames.values())) == len(frames)


def test_the_values_are_those_of_the_last_row(record: RunRecord, view: RecordView) -> None:
    """The plant's values at a time are its last row up to then, and the strips end with it."""
    history = record.physics()
    config = record.info.agents[2]
    column = history.inverters.index(config.name)
    for t in (0.0, 0.213, 1.6):
        row = [k for k, at in enumerate(history.t) if at <= t + 1e-9][-1]
        frame = view.frame(t)
        shown = next(one for one in frame.inverters if one.name == config.name)

        assert frame.t == t
        assert history.P[row, column] / 1e3 == shown.P
        assert shown.f == history.f[row, column]
        assert history.V[row, column] / config.V_nom == shown.V
        assert frame.points[-1][0] == pytest.approx(history.t[row])
        assert frame.points[-1][1][column] == round(history.f[row, column], 4)
        assert (frame.live.word, shown.received) == ("record", None)


def test_the_links_are_as_the_decisions_have_them(record: RunRecord, view: RecordView) -> None:
    """Whom an agent hears, how old its states are, and whom it uses are the inputs of its decision in force then."""
    for t in (0.1, 0.5, 1.333):
        frame = view.frame(t)
        for agent in record.agents:
            inputs = {each.name: each for each in record.decision(agent, t).neighbours}
            links = {link.src: link for link in frame.links[agent]}
            assert links.keys() == inputs.keys()
            for name, link in links.items():
                age = inputs[name].age
                assert age is not None
                assert link.age == pytest.approx(age, abs=0.0006)
                assert (link.state == "used") == (inputs[name].unused == "")


def test_what_a_law_shares_is_in_the_strips_too(tmp_path: Path) -> None:
    """Behind the values of the paper, quantity by quantity, as the record has it at the time of each point."""
    text = ISLANDED.replace("1.6", "0.6").replace('"full"', '"full"\nlaw = "centralised"')
    record = recorded_in_chunks(text, tmp_path)
    view, shared = RecordView(record), read_shared(record)
    names = [quantity.name for quantity in view.shared]
    whole = view.frame(0.6).points

    assert names == ["omega", "E", "v"]
    assert whole[0][1][4 * 9 + 2 :] == (None,) * 27, "the law is on hold"
    for t, values, _ in (point for point in whole if point[0] > 0.3):
        row = shared.loc[: t + 1e-9].iloc[-1]
        expected = [row.get((name, inverter)) for name in names for inverter in record.info.inverters]
        assert values[4 * 9 + 2 :] == tuple(None if value is None or isnan(value) else value for value in expected)
    assert view.frame(0.6, since=whole[-4][0]).points == whole[-3:]


def test_faults_of_links_are_those_of_the_time(view: RecordView) -> None:
    """A cut shows from its beginning on, in both directions; a lossy link says how much it has lost of late."""

    def link(t: float, src: str, dst: str) -> tuple[bool, float, float]:
        (found,) = (each for each in view.frame(t).links[dst] if each.src == src)
        return found.cut, found.lost, found.rate

    assert [link(t, "inv7", "inv4")[0] for t in (0.48, 0.5, 1.5)] == [False, True, True]
    assert link(1.5, "inv4", "inv7")[0]
    assert link(1.5, "inv4", "inv7")[2] == 0.0, "nothing comes over it"
    _, lost, rate = link(1.5, "inv1", "inv2")
    assert 0.3 < lost < 0.7
    assert rate == pytest.approx(50.0 * (1.0 - lost), abs=1.0)
    assert link(1.5, "inv1", "inv3") == (False, 0.0, 50.0)


def test_switches_eachevents_are_those_of_the_time(view: RecordView) -> None:
    """A switch has its position of the time, also going back; events are listed once, in their order."""
    positions = [view.frame(t).switches for t in (0.19, 0.2, 1.0, 0.0)]

    assert [each and each["13-152"] for each in positions] == [True, False, False, True]
    assert [event.number for event in view.events] == list(range(1, len(view.events) + 1))
    assert [event.t for event in view.events] == sorted(event.t for event in view.events)
    assert view.events[0].text == "switch 13-152 opened"


def test_a_record_of_the_physics_shows_them_eachsays_what_it_lacks(tmp_path: Path) -> None:
    """No link and no age is made up; agents are there as the scenario says."""
    (tmp_path / "it.toml").write_text(ISLANDED.replace("1.6", "0.6"), encoding="utf-8")
    view = RecordView(recorded_run(tmp_path / "it.toml", "case", tmp_path / "case", level="physics"))
    frame = view.frame(0.3)

    assert frame.inverters[0].P is not None
    assert {one.note for one in frame.inverters} == {""}
    assert not any(frame.links.values())
    assert view.missing == ('The record has no links and no decisions (record = "physics").',)


def test_without_the_feeder_the_inverters_steachin_a_ring(record: RunRecord, tmp_path: Path) -> None:
    """A feeder of one's own may have moved since the run; the rest of the page does not depend on it."""
    copy = RunRecord.open(shutil.copy(record.path, tmp_path))
    settings = msgspec.structs.replace(copy.info.plant.settings, feeder=str(tmp_path / "gone"))
    copy.info = msgspec.structs.replace(copy.info, plant=msgspec.structs.replace(copy.info.plant, settings=settings))
    view = RecordView(copy)

    assert [row.name for row in view.map.inverters] == list(copy.info.inverters)
    assert len({bus[1:] for bus in view.map.buses}) == len(copy.info.inverters)
    assert view.map.branches == ()
    assert "gone is not on this host" in view.missing[-1]
    assert view.frame(0.3).inverters[0].P is not None


def test_long_steps_leave_no_gaps(tmp_path: Path) -> None:
    """With a second and more between two rows, every time in between has the row before, and the agents."""
    text = '[time]\nT_c_s = 2.0\nrecord_s = 2.0\nend_s = 8.0\n[case.case]\nsecondary = "all"\ngraph = "ring"\n'
    record = recorded_in_chunks(text, tmp_path, chunk=1)
    view, history = RecordView(record), record.physics()
    for t in (0.5, 1.8, 3.99, 4.0, 5.7, 7.9):
        frame = view.frame(t)
        row = [k for k, at in enumerate(history.t) if at <= t + 1e-9][-1]

        assert frame.live.text == "record"
        assert [one.P for one in frame.inverters] == list(history.P[row] / 1e3)
        assert {one.note for one in frame.inverters} == {""}
