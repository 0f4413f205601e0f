"""The account of what arrives in real time: over joins, kills and freezes, and one message that is lost."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gridpeers.lab.communication.accounts import ArrivalAccounts
from gridpeers.lab.communication.communication_checks import MessageAccount, summarise
from gridpeers.lab.communication.record_pass import read_content
from gridpeers.lab.communication.sent_states import SentState
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.wire.journal import RecordLevel
from tests.record.fake_clock import FakeClockRun, fake_clock_record

LINK = ("inv1", "inv2")

LINKED_WITHIN = 7.0  # Time (s) after which two processes that are there must hear each other
IN_FLIGHT = 1.0  # Time (s) before the end of either side that is left out, as the check does


def missing(
    sender: Callable[[int], int | None],
    receiver: Callable[[int], int | None],
    lost: Collection[int],
    renewed: str = "",
    told_at: int = 50,
) -> list[float]:
    """Run times (s) of the states that are missing, of 10 s with ten states a second.

    `sender` and `receiver` give the epoch of the process at a tick, None where there is none or it is frozen; `lost`
    are the ticks whose state does not arrive. An agent that is `renewed` opens a new session after tick 50, and its
    journal tells it at a later tick.
    """
    accounts = ArrivalAccounts(1.5, LINKED_WITHIN)
    for k in range(100):
        t = round(0.1 * k, 9)
        for agent, process in (("inv1", sender), ("inv2", receiver)):
            if (epoch := process(k)) is not None:
                accounts.listens(LINK)
                accounts.state(agent, SentState(k, t, epoch, idle=False, quiet=False))
        if (epoch := sender(k)) is not None and k not in lost:
            accounts.heard(LINK, epoch, k)
        if renewed and k == told_at:
            for _ in range(2):  # a part of a journal may come twice
                accounts.renewed(renewed, 5.0)
    accounts.flush(10.0)
    found = accounts.accounts[LINK]
    return [t for account in found for t in account.missing.values() if t <= account.until - IN_FLIGHT]


def always(k: int) -> int:
    return 1


def restarted(k: int) -> int:
    """Another process from 5 s on."""
    return 1 if k < 50 else 2


def silent(since: int, until: int = 100) -> Callable[[int], int | None]:
    """One process that is dead, or frozen, between two ticks."""
    return lambda k: None if since <= k < until else 1


@pytest.mark.parametrize(
    ("ends", "lost", "told"),
    [
        ((always, always), [], []),
        ((always, always), [40], [4.0]),
        ((restarted, always), [50, 51, 52, 53, 70], [7.0]),
        ((always, restarted), [50, 51, 52, 53, 70], [7.0]),
        ((silent(60), always), [40, 58, 59], [4.0]),
        ((silent(30, 60), always), [10, *range(29, 65), 80], [1.0, 8.0]),
        ((always, silent(30, 60)), [10, *range(29, 65), 80], [1.0, 8.0]),
        ((silent(30, 40), always), [29], [2.9]),
    ],
    ids=["sound", "lost", "sender anew", "receiver anew", "killed", "sender frozen", "receiver frozen", "short pause"],
)
def test_a_state_is_missing_between_processes_that_are_there(ends: Any, lost: list[int], told: list[float]) -> None:
    """The first ones of a new process come before its links do; the last second of a killed one may not leave it.

    Links of a process that is frozen for long are given up, and made anew; those of a short pause stay.
    """
    assert missing(*ends, lost) == told


@pytest.mark.parametrize("renewed", LINK)
@pytest.mark.parametrize("told_at", [50, 70])
def test_the_links_of_a_new_session_are_made_anew(renewed: str, told_at: int) -> None:
    """Either end opens one at 5 s: what is lost in the second before and until something arrives is no fault."""
    ends = always, always
    assert missing(*ends, range(45, 56), renewed, told_at) == []
    assert missing(*ends, [30, *range(45, 56), 70], renewed, told_at) == [3.0, 7.0]
    assert missing(*ends, range(45, 56)) == [round(0.1 * k, 9) for k in range(45, 56)]


def test_a_new_session_over_which_nothing_arrives_is_missed() -> None:
    """From 7 s after it was opened, here at the end of a longer run."""
    accounts = ArrivalAccounts(1.5, LINKED_WITHIN)
    for k in range(200):
        for agent in LINK:
            accounts.state(agent, SentState(k, 0.1 * k, 1, idle=False, quiet=False))
        if k <= 50:
            accounts.heard(LINK, 1, k)
        if k == 50:
            accounts.renewed("inv2", 0.1 * k)
    accounts.flush(20.0)

    (first, second) = accounts.accounts[LINK]
    assert not first.missing
    assert min(second.missing.values()) == pytest.approx(12.1)


LOST = range(50, 60)  # Numbers of the messages from inv1 to inv2 that never arrive: those of 1.0 to 1.2 s


LOST_OF = "states of inv1 neither heard nor lost: inv2 {} s (limit 0)"
ALL_LOST = [LOST_OF.format("10 at t = 1.00")]


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


@pytest.mark.parametrize(
    ("told", "lost"),
    [
        (("inv2", "state/inv1", 10, "excess"), []),
        (
            ("inv2", "state/inv1", 9, "excess"),
            ["states of inv1 neither heard nor lost: inv2 1 at t = 1.18 s (limit 0)"],
        ),
        (("inv2", "state/inv3", 500, "excess"), ALL_LOST),
        (("inv3", "state/inv1", 500, "excess"), ALL_LOST),
        (("inv2", "state/inv1", 500, "garbled"), ALL_LOST),
    ],
    ids=["all", "all but one", "of another sender", "by another receiver", "no state of anybody"],
)
def test_states_that_their_receiver_tells_to_have_dropped_are_accounted_for(
    told: tuple[str, str, int, str], lost: list[str], tmp_path: Path
) -> None:
    """A flood displaces them; then the record has their number. What else was dropped excuses nothing."""
    assert violations(tmp_path, losing(told)) == lost


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
    with pytest.raises(NotJudgedError, match='record = "decisions" has no arrivals'):
        violations(tmp_path, lambda run: None, end=8.5, record="decisions")
