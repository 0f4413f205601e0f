"""The message account of wall-clock time, where receivers drop states: what they tell of closes it, and nothing else.

`tests.record.fake_clock` decides which states are lost on the wire, so the account has to agree to the message.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gridpeers.lab.communication.communication_checks import MessageAccount, summarise
from gridpeers.lab.communication.record_pass import read_content
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.wire.journal import RecordLevel
from tests.record.fake_clock import FakeClockRun, fake_clock_record

LOST = range(50, 60)
"""Numbers of the messages from inv1 to inv2 that never arrive: those of 1.0 to 1.2 s."""


def violations(
    folder: Path, happens: Callable[[FakeClockRun], None], end: float = 3.0, record: RecordLevel = "all"
) -> list[str]:
    """Return the verdict of the check on a run of the toy plant over such a wire."""

    def delay(src: str, dst: str, key: str, number: int) -> float | None:
        return None if (key, dst) == ("state/inv1", "inv2") and number in LOST else 0.001

    fake_clock_record(folder / "run", end=end, record=record, delay=delay, happens=happens)
    case: Any = SimpleNamespace(communication=summarise(folder / "run" / FILE))
    return [violation.sentence for violation in MessageAccount()(cast(CheckedCase, case))]


def losing(*told: tuple[str, str, int, str], at: float = 1.3) -> Callable[[FakeClockRun], None]:
    """Processes that tell, at a run time (s), of a number of dropped messages on a key."""

    def happens(run: FakeClockRun) -> None:
        for name, key, number, kind in told:
            run.at(at, lambda name=name, key=key, number=number, kind=kind: run.lose(name, key, number, kind))

    return happens


def test_states_that_their_receiver_tells_to_have_dropped_are_accounted_for(tmp_path: Path) -> None:
    """A flood displaces them; then the record has their number, and the account closes."""
    assert violations(tmp_path, losing(("inv2", "state/inv1", 10, "excess"))) == []


def test_of_more_missing_states_than_were_dropped_the_rest_fails(tmp_path: Path) -> None:
    """Ten are missing, nine were dropped: one is lost without a word."""
    assert violations(tmp_path, losing(("inv2", "state/inv1", 9, "excess"))) == [
        "states of inv1 neither heard nor lost: inv2 1 at t = 1.18 s (limit 0)"
    ]


@pytest.mark.parametrize(
    "told",
    [
        ("inv2", "state/inv3", 500, "excess"),
        ("inv3", "state/inv1", 500, "excess"),
        ("inv2", "state/inv1", 500, "garbled"),
    ],
    ids=["of another sender", "by another receiver", "no state of anybody"],
)
def test_what_else_was_dropped_excuses_nothing(tmp_path: Path, told: tuple[str, str, int, str]) -> None:
    """Neither on another link, nor what no sender of sound states has sent."""
    assert violations(tmp_path, losing(told)) == [
        "states of inv1 neither heard nor lost: inv2 10 at t = 1.00 s (limit 0)"
    ]


def test_states_that_were_rejected_have_arrived(tmp_path: Path) -> None:
    """Whoever does not see a sender's token for a while takes its states for a ghost's, and notes each."""

    def happens(run: FakeClockRun) -> None:
        losing(("inv2", "state/inv1", 10, "excess"))(run)
        run.at(1.6, lambda: run.lose_sight("inv2", "inv3", 0.3))

    found = violations(tmp_path, happens)
    content = read_content(tmp_path / "run" / FILE)

    assert found == []
    assert 10 < list(content.heard["inv3", "inv2"].values()).count("ghost") < 20
    assert content.dropped["inv1", "inv2"] == 10


def test_a_record_without_arrivals_is_not_judged(tmp_path: Path) -> None:
    """Where nobody has noted what arrived, nothing is missing; after 7 s every state would be."""
    with pytest.raises(NotJudgedError, match='record = "decisions" does not have what arrived'):
        violations(tmp_path, lambda run: None, end=8.5, record="decisions")
