"""Runs of the toy plant on a fake clock, replayed: what differs is named, and what cannot be known is said."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.lab.replay.changes import spliced
from gridpeers.lab.replay.recorded_process import JournalParts, RecordedProcess, RecordedStep, agent_again, processes_of
from gridpeers.lab.replay.replay import ComparedRows, ReplayedPart, message_difference, replay
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.partition import Partition
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.journal import ReceivedMessage, RejectedCount
from gridpeers.wire.messages import State, Telemetry
from tests.record.fake_clock import FakeClockRun, fake_clock_record
from tests.toy.toy_plant import ISLANDING, ToyPlant

STATE = State(sender="inv1", epoch=1, seq=3, t=0.06, P_set=5e4, V_set=277.0, Q=1e3, shared={"w": 0.5})


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """Three agents, of which one dies and comes again, with a link that loses messages."""

    def happens(run: FakeClockRun) -> None:
        run.at(0.4, lambda: run.kill("inv2"))
        run.at(0.6, lambda: run.start("inv2"))

    netem = Netem(links=(Fault(on="inv1 -> inv3", loss=0.5),))
    return fake_clock_record(tmp_path_factory.mktemp("run") / "case", netem=netem, happens=happens)


def parts_of(record: RunRecord) -> dict[str, list[ReplayedPart]]:
    found: dict[str, list[ReplayedPart]] = {}
    for part in replay(record, ToyPlant).parts:
        found.setdefault(part.name, []).append(part)
    return found


def test_a_replay_compares_everything(record: RunRecord) -> None:
    """Each row of the plant and each state of its agents; of a killed one those that its journal has, in both lives."""
    parts = parts_of(record)

    rows = [row for message in record.telemetry() for row in message.rows]
    assert (parts["plant"][0].count, parts["plant"][0].t_end) == (len(rows), rows[-1][0])
    assert list(parts) == ["plant", "inv1", "inv2", "inv3"]
    assert [len(parts[name]) for name in parts] == [1, 1, 2, 1]
    for name in ("inv1", "inv2", "inv3"):
        states = list(record.messages(State, name))
        lost = len(states) - sum(part.count for part in parts[name])
        assert 0 < lost < 10 if name == "inv2" else lost == 0
        assert parts[name][-1].t_end == pytest.approx(states[-1].t)
    assert all(part.difference is None for of in parts.values() for part in of)


def test_another_gain_is_named_where_it_first_acts(record: RunRecord) -> None:
    """Nothing of a replay reaches another process: the others, and the plant, are the same."""
    other = RunRecord.open(record.path)
    agents = [
        replace(agent, control=replace(agent.control, gains=replace(agent.control.gains, k_p=0.5)))
        if agent.name == "inv3"
        else agent
        for agent in other.info.agents
    ]
    other.info = replace(other.info, agents=tuple(agents))

    done = replay(other, ToyPlant)

    assert {part.name for part in done.parts if part.difference is not None} == {"inv3"}
    assert done.difference is not None
    assert (done.difference.name, done.difference.quantity, done.difference.unit) == ("inv3", "P_set", "W")
    assert ISLANDING <= done.difference.t < 0.2


# -------------------------------------------------------------------- the processes of a record


def steps_of(record: RunRecord, name: str) -> list[tuple[RecordedProcess, list[RecordedStep]]]:
    return [(each, list(each.steps())) for each in processes_of(record) if each.name == name]


@pytest.mark.parametrize(("missing", "told"), [(2, "lacks 1 of its parts"), (0, "begins")])
def test_where_parts_of_a_journal_are_lost_its_steps_end(missing: int, told: str, record: RunRecord) -> None:
    """What comes behind cannot be given to the node that lacks what was before; it says where, and why."""
    whole = JournalParts(record.index)
    process = next(each for each in whole.processes() if each.name == "inv1")
    count, of = len(list(process.steps())), whole.of

    def with_a_gap(number: int) -> dict[tuple[str, int], list[Any]]:
        return {key: [each for each in parts if each[0].seq != missing] for key, parts in of(number).items()}

    whole.of = with_a_gap  # type: ignore[assignment]

    assert len(list(process.steps())) < count
    assert process.ends.startswith(f"the journal of inv1 {told} at t = ")


@pytest.mark.parametrize(("entry", "counts"), [
    (RejectedCount(1001.0, "state/inv2", "excess", 500), {"excess": 500}),
    (RejectedCount(1001.0, "state/inv2", "of a later version", 7), {}),
    (ReceivedMessage(1001.0, "measurement/inv1", b"", "corrupt"), {"corrupt": 1}),
])  # fmt: skip
def test_what_was_rejected_unseen_is_rejected_again_by_its_number(
    entry: RejectedCount | ReceivedMessage, counts: dict[str, int], record: RunRecord
) -> None:
    """As it was: a message that was dropped unread is no corrupt one, though it has no bytes here."""
    (process, (start, *_)), *_ = steps_of(record, "inv1")
    config = record.info.agent("inv1")
    assert config is not None
    again = agent_again(process, config, "a", [], None)
    again.take(start)
    step = RecordedStep(1001.0, entry, (), 0.1)

    assert again.take(step, process.message(step)) == []
    assert again.node.rejects.counts == counts


# -------------------------------------------------------------------- differences


@pytest.mark.parametrize(("changes", "found"), [
    ({}, None),
    ({"P_set": 5e4 + 1e-10}, None),
    ({"P_set": 5e4 + 1e-8}, ("P_set", "W")),
    ({"shared": {"w": 0.5 + 1e-10}}, None),
    ({"shared": {"w": 0.6}}, ("shared", "")),
    ({"quiet": True}, ("quiet", "")),
])  # fmt: skip
def test_the_first_field_that_differs_is_named(changes: dict[str, Any], found: tuple[str, str] | None) -> None:
    """With its unit; numbers are the same within 1e-9."""
    difference = message_difference(STATE, replace(STATE, **changes))

    assert (None if difference is None else (difference.quantity, difference.unit)) == found
    assert difference is None or (difference.name, difference.t) == ("inv1", 0.06)


def test_rows_are_compared_up_to_a_time(record: RunRecord) -> None:
    """Each once, though the plant tells them again; the first difference ends it."""
    messages = list(record.telemetry())
    rows = ComparedRows(record, until=0.5)
    for message in (*messages[:3], *messages):
        rows.take(message)
    assert (rows.part.count, rows.part.t_end) == (26, pytest.approx(0.5))
    assert rows.part.difference is None

    changed = ComparedRows(record)
    for message in messages:
        changed.take(raised(message, 0.3))
    difference = changed.part.difference
    assert difference is not None
    assert (difference.t, difference.quantity) == (pytest.approx(0.3), "f")
    assert changed.part.count == 15


def raised(message: Telemetry, t: float) -> Telemetry:
    """Telemetry whose rows from a time on have a higher frequency of the first inverter."""
    rows = tuple((row[0], row[1] + 1.0, *row[2:]) if row[0] > t - 1e-9 else row for row in message.rows)
    return replace(message, rows=rows)


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


@pytest.mark.parametrize("since", [0.0, 1.5, 4.0, 8.0])
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
