"""Messages as flows, in real time and by the verdicts of emulated links."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gridpeers.lab.trace import Flow, flows
from gridpeers.netem.ledger import LinkTrace, Outcome
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.codec import encode
from gridpeers.wire.journal import Entry, ReceivedMessage, SentMessage
from gridpeers.wire.messages import Journal
from tests.record.fake_clock import fake_clock_record
from tests.unit.lab.explanation.decisions import state


def record_of(
    *traces: LinkTrace, clock: str = "simulated", speed: float = 1.0, entries: tuple[tuple[Journal, Entry], ...] = ()
) -> RunRecord:
    """A record with verdicts of links, and entries of journals, alone."""
    none: Any = lambda *words, **more: iter(())  # noqa: E731
    info = SimpleNamespace(T_c=0.02, clock=clock, plant=SimpleNamespace(speed=speed))
    index = SimpleNamespace(near=lambda *times: (0,), part=lambda number: SimpleNamespace(entries=entries))
    return cast(
        RunRecord,
        SimpleNamespace(links=lambda: traces, info=info, agents=(), index=index, messages=none, decisions=none),
    )


def judged(*rows: tuple[float, Outcome], clock: str = "simulated") -> list[Flow]:
    """Flows of the link from inv2 to inv1 whose messages have these times and verdicts."""
    times, outcomes = zip(*rows, strict=True)
    return flows(record_of(LinkTrace("inv2", "inv1", tuple(range(5, 5 + len(rows))), times, outcomes), clock=clock))


def test_in_ticks_a_message_arrives_with_the_decision_that_can_use_it() -> None:
    """One period after it was sent at the earliest, or after its delay; what a link keeps never arrives."""
    found = judged((0.1, 0.0), (0.12, 0.05), (0.14, "loss"), (0.16, float("inf")))

    assert [(flow.number, flow.sent, flow.fate, flow.arrived is None) for flow in found] == [
        (5, 0.1, "", False),
        (6, 0.12, "", False),
        (7, 0.14, "loss", True),
        (8, 0.16, "kept", True),
    ]
    assert [flow.arrived for flow in found[:2]] == [pytest.approx(0.12), pytest.approx(0.17)]
    assert found[0][1:3] == ("inv2", "inv1")
    assert judged((0.1, 0.003), clock="realtime")[0].arrived == pytest.approx(0.103)


def test_in_real_time_messages_arrive_when_their_receivers_noted_them(tmp_path: Path) -> None:
    """Every message in the record that was heard, from its sender to its receiver, after the time that it took."""

    def delay(src: str, dst: str, key: str, number: int) -> float | None:
        return None if (src, dst) == ("inv1", "inv3") and number == 4 else 0.004

    record = fake_clock_record(tmp_path / "case", end=0.5, delay=delay)

    found = flows(record)

    links = {(flow.src, flow.dst) for flow in found}
    names = ("inv1", "inv2", "inv3")
    assert links == {(a, b) for a in (*names, "plant") for b in (*names, "plant") if a != b}
    numbers = {link: [flow.number for flow in found if flow[1:3] == link] for link in links}
    assert 4 in numbers["inv1", "inv2"]
    assert 4 not in numbers["inv1", "inv3"]
    assert all(of == sorted(set(of)) for of in numbers.values())
    assert {round((flow.arrived or 0.0) - flow.sent, 6) for flow in found} == {0.004}
    assert {flow.fate for flow in found} == {""}
    some = flows(record, since=0.2, until=0.3)
    assert {flow for flow in found if 0.2 <= flow.sent <= 0.3} == set(some)


def test_with_speed_the_way_of_a_message_is_run_time() -> None:
    """A millisecond by the clock is ten of a run at ten times real time; a rejected message says so."""
    payload = encode(state("inv2", 5))
    sent, heard = (Journal(sender=name, epoch=1, seq=0, t=0.1, data=b"") for name in ("inv2", "inv1"))
    entries = (
        (sent, SentMessage(10.0, "state/inv2", payload)),
        (heard, ReceivedMessage(10.001, "state/inv2", payload, "stale")),
    )

    found = flows(record_of(clock="realtime", speed=10.0, entries=entries))

    assert found == [Flow(0.1, "inv2", "inv1", 5, pytest.approx(0.11), "stale")]
