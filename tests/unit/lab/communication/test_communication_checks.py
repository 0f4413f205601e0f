"""All checks of messages and agents: sound runs pass, and records of any size and order are judged."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import msgspec
import pytest

from gridpeers.lab.communication import record_pass
from gridpeers.lab.communication.communication_checks import CommunicationSummary
from gridpeers.lab.communication.sent_states import SentState
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.wire.journal import Decision
from gridpeers.wire.messages import State
from tests.unit.lab.communication.records import CUT, LOSSY, QUIET
from tests.unit.scenarios.checks.cases import ran_with, verdict, with_content

COMMUNICATION = ("message_account", "heal", "stale_values", "last_words")
EVENT = [{"label": "islanding", "t_s": 0.5, "open": ["13-152"]}]
NAMES = ("inv1", "inv2", "inv3")

Changes = tuple[tuple[str, str], ...]


@pytest.mark.parametrize("check", ["message_account", "stale_values", "last_words"])
def test_a_sound_run_passes(sound: CheckedCase, check: str) -> None:
    """Without faults of links everything is heard in time."""
    assert verdict(sound, check).sentence == f"{check} passed"


@pytest.mark.parametrize("check", COMMUNICATION)
def test_without_decisions_nothing_is_judged(sound: CheckedCase, check: str) -> None:
    """A run in memory has no messages to look at, and record = "physics" has rows and events alone."""
    physics = (("record", repr("physics")), ("time.end_s", "1.5"), ("event", repr(EVENT)))
    without = verdict(ran_with(physics).checked_case, check)
    none = verdict(replace(sound, folder=None), check)

    assert (without.status, 'record = "physics"' in without.reason) == ("not judged", True)
    assert (none.status, none.reason) == ("not judged", "the run has no record run.mcap")


def test_the_pass_over_a_record_agrees_with_its_reader() -> None:
    """States and decisions are those that `RunRecord` has, which makes each again."""
    result = ran_with(LOSSY)
    content, record = result.checked_case.content, result.run_record

    for agent in ("inv1", "inv5"):
        sent = [state.seq for state in record.messages(State, agent)]
        assert [state.number for state in sorted(content.states[agent].values(), key=lambda it: it.t)] == sent
    assert dict(content.counts) == record.link_counts()


@pytest.mark.parametrize(
    ("check", "changes"), [("message_account", LOSSY), ("heal", CUT), ("stale_values", QUIET), ("last_words", QUIET)]
)
def test_journals_that_come_late_change_no_verdict(check: str, changes: Changes) -> None:
    """Decisions and verdicts of links come into a record a while after the states that they are about."""
    case = ran_with(changes).checked_case
    at_once, late = (with_content(case, case.content, late=late) for late in (0.0, 2.0))

    assert verdict(at_once, check) == verdict(late, check) == verdict(case, check)
    assert check in ("heal", "stale_values") or verdict(case, check).status == "passed"


def test_a_record_of_any_size_is_judged(sound: CheckedCase, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shipped checks read a record in parts; only its whole content, for a check of one's own, has a limit."""
    monkeypatch.setattr(record_pass, "MOST_BYTES", 1000)
    large = replace(sound)

    assert verdict(large, "message_account").status == "passed"
    with pytest.raises(NotJudgedError, match="more than the 0 MB that are taken into memory"):
        _ = large.content


@pytest.mark.parametrize("clock", ["simulated", "realtime"])
def test_the_memory_of_a_pass_does_not_grow_with_the_run(sound: CheckedCase, clock: str) -> None:
    """Three times the run, the same memory: what is done with is forgotten."""
    info = sound.content.info
    info = msgspec.structs.replace(info, plant=msgspec.structs.replace(info.plant, clock=clock))

    def memory(ticks: int) -> int:
        tracemalloc.start()
        sums = CommunicationSummary(info, ticks * info.T_c)
        for number in range(ticks):
            for agent in NAMES:
                sums.take_state(agent, SentState(number, number * info.T_c, 1, idle=False, quiet=number % 3 == 1))
                said = [2, 1] if clock == "simulated" else [number - 1, number]
                sums.take_decision(agent, 1, Decision(number, 0, [n for n in NAMES if n != agent], said, [], []))
                for other in NAMES:
                    if other != agent and number % 3 != 1:
                        sums.take_heard((other, agent), 1, number, "")
        size, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert sums.finish().oldest
        return size

    memory(300)  # makes what is kept for good
    assert memory(4500) < 1.1 * memory(1500)
