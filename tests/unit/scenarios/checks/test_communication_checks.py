"""Checks of messages and agents: the sound case passes, and each planted fault is caught."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

import gridpeers as gp
from scenarios.checks.check_verdict import NotJudgedError
from scenarios.checks.checked_case import CheckedCase
from scenarios.checks.communication import record_content
from scenarios.checks.communication.communication_summary import LINKED_WITHIN, SummaryPass
from scenarios.checks.communication.link_accounts import MOST_WAITING, ArrivalAccounts, Missing
from scenarios.checks.communication.record_content import RecordContent
from scenarios.checks.communication.record_pass import SentState
from scenarios.checks.communication.sent_states import SentStates
from scenarios.checks.communication.state_window import StateWindow
from scenarios.checks.judging import judge_by
from scenarios.record.record_file import RecordFile
from tests.unit.scenarios.checks.cases import ran, ran_with, verdict, with_content
from wire.journal import Decision
from wire.plugins.plugin import Plugin

COMMUNICATION = ("message_account", "heal", "stale_values", "last_words")

LOSSY = (("case.IV.link", repr([{"on": "* <-> *", "loss": 0.2, "delay": 0.03}])),)
CUT = (("case.IV.link", repr([{"on": "inv2 <-> *", "cut": True, "from_s": 2.0, "to_s": 2.16}])), ("time.end_s", "5.0"))
QUIET = (("law", repr({"use": "event-triggered"})), ("case.IV.link", repr([{"on": "* <-> inv2", "loss": 0.1}])))
KILLED = (("node", repr([{"name": "inv2", "kill": True, "from_s": 2.0}])), ("time.end_s", "5.0"))

NAMES = ("inv1", "inv2", "inv3")

Changes = tuple[tuple[str, str], ...]


@pytest.fixture(scope="module")
def sound() -> CheckedCase:
    """Islanding under full coordination."""
    return ran().checked_case


@pytest.mark.parametrize("check", ["message_account", "stale_values", "last_words"])
def test_a_sound_run_passes(sound: CheckedCase, check: str) -> None:
    """Without faults of links everything is heard in time."""
    assert verdict(sound, check).sentence == f"{check} passed"


@pytest.mark.parametrize("check", ["message_account", "stale_values", "last_words"])
def test_a_run_on_lossy_links_is_accounted_for(check: str) -> None:
    """Losses and delays of emulated links are on the account."""
    assert verdict(ran_with(LOSSY).checked_case, check).sentence == f"{check} passed"


def test_a_silence_longer_than_the_run_is_not_judged(sound: CheckedCase) -> None:
    """No agent could break it; one that never sends a state still does."""
    content = sound.content
    states = {name: states for name, states in content.states.items() if name != "inv9"}
    silent = verdict(with_content(sound, replace(content, states=states)), "last_words", silent_s=3600.0)

    assert verdict(sound, "last_words", silent_s=3600.0).reason.endswith("7 s to judge, and silent_s = 3600 s")
    assert (silent.status, silent.violations[0].text) == ("failed", "never sends a state")


@pytest.mark.parametrize(("in_flight_s", "status"), [(7.0, "not judged"), (6.0, "passed")])
def test_in_wall_clock_time_a_time_of_flight_longer_than_the_run_is_not_judged(in_flight_s: float, status: str) -> None:
    """All that was sent may be on its way; in simulated time nothing is, so that the limit does not matter."""
    found = SimpleNamespace(
        unreadable=0,
        counts={},
        unjudged={},
        agents=("inv1", "inv2"),
        simulated=False,
        has_arrivals=True,
        arrivals={("inv1", "inv2"): []},
        t_end=7.0,
    )
    limits = (("in_flight_s", in_flight_s),)
    case: Any = SimpleNamespace(communication=found, case="IV")
    (judged,) = judge_by({"message_account": Plugin(use="message_account", parameters=limits)}, case)

    assert judged.status == status
    found.simulated, found.unheard = True, {("inv1", "inv2"): Missing()}
    (judged,) = judge_by({"message_account": Plugin(use="message_account", parameters=limits)}, case)
    assert judged.status == "passed"


def test_without_a_cut_there_is_no_heal_to_judge(sound: CheckedCase) -> None:
    """No cut, no verdict."""
    assert verdict(sound, "heal").sentence == "heal not judged: no link was cut and healed"


@pytest.mark.parametrize("check", COMMUNICATION)
def test_without_decisions_in_the_record_nothing_is_judged(check: str) -> None:
    """Record = "physics" has rows and events alone: the verdict says so, and is not "passed"."""
    found = verdict(
        ran_with((("record", repr("physics")), ("time.end_s", "1.5"), ("event", repr(EVENT)))).checked_case, check
    )

    assert (found.status, 'record = "physics"' in found.reason) == ("not judged", True)


EVENT = [{"label": "islanding", "t_s": 0.5, "open": ["13-152"]}]


@pytest.mark.parametrize("check", COMMUNICATION)
def test_without_a_record_nothing_is_judged(sound: CheckedCase, check: str) -> None:
    """A run in memory has no messages to look at."""
    found = verdict(replace(sound, folder=None), check)

    assert (found.status, found.reason) == ("not judged", "the run has no record run.mcap")


# ---------------------------------------------------------------- planted faults


def test_an_account_that_does_not_close_is_caught() -> None:
    """A link that loses a message without a word: sent is more than delivered, dropped and in flight."""
    case = ran_with(LOSSY).checked_case
    link = ("inv1", "inv2")
    counts = case.content.counts[link]
    wrong = dict(case.content.counts) | {link: msgspec.structs.replace(counts, delivered=counts.delivered - 1)}
    found = verdict(with_content(case, replace(case.content, counts=wrong)), "message_account")

    assert (found.count, found.violations[0].agent) == (1, "inv2")
    assert found.violations[0].value == (found.violations[0].limit or 0) - 1


def test_a_message_without_a_verdict_is_caught() -> None:
    """A state that its sender noted, and that the emulated link never judged."""
    case = ran_with(LOSSY).checked_case
    link = ("inv1", "inv2")
    first, *others = case.content.traces[link]
    short = type(first)(first.src, first.dst, first.seq[:-9] + first.seq[-8:], first.t[:-9] + first.t[-8:],
                        first.outcome[:-9] + first.outcome[-8:])  # fmt: skip
    wrong = dict(case.content.traces) | {link: [short, *others]}
    found = verdict(with_content(case, replace(case.content, traces=wrong)), "message_account")

    assert (found.count, found.violations[0].agent, found.violations[0].value) == (1, "inv2", 1.0)
    assert "states of inv1 without a verdict" in found.violations[0].text


def test_a_state_that_never_arrived_is_caught(sound: CheckedCase) -> None:
    """Without faults of links a decision has the states of the tick before: one that uses an older one has lost it."""
    content = sound.content
    epoch, entry = content.decisions["inv3"][-1]
    late = msgspec.structs.replace(entry, tick=200, states=[3, *entry.states[1:]])
    decisions = dict(content.decisions) | {"inv3": [*content.decisions["inv3"], (epoch, late)]}
    found = verdict(with_content(sound, replace(content, decisions=decisions)), "message_account")

    assert (found.status, found.violations[0].agent, found.violations[0].t) == ("failed", "inv3", pytest.approx(4.0))
    assert f"states of {entry.neighbours[0]} neither heard nor lost" in found.violations[0].text


def test_a_value_that_nobody_sent_is_caught(sound: CheckedCase) -> None:
    """A decision that names a state which its sender never sent."""
    content = sound.content
    states = dict(content.states)
    states["inv1"] = {key: state for key, state in states["inv1"].items() if state.number != 150}
    found = verdict(with_content(sound, replace(content, states=states)), "message_account")

    assert found.status == "failed"
    assert found.violations[0].t == pytest.approx(3.02)


def test_a_stale_value_is_caught(sound: CheckedCase) -> None:
    """A value of 0.4 s where 0.25 s is the limit, with who used it and when."""
    content = sound.content
    epoch, entry = content.decisions["inv3"][-1]
    late = msgspec.structs.replace(entry, tick=200, states=[20, *entry.states[1:]])
    decisions = dict(content.decisions) | {"inv3": [*content.decisions["inv3"], (epoch, late)]}
    old = with_content(sound, replace(content, decisions=decisions))
    found = verdict(old, "stale_values")

    assert (found.count, found.violations[0].agent, found.violations[0].unit) == (1, "inv3", "s")
    assert (found.violations[0].value, found.violations[0].limit) == (pytest.approx(0.4), 0.25)
    assert found.violations[0].t == pytest.approx(4.0)
    assert verdict(old, "stale_values", max_age_s=0.5).status == "passed"


def test_a_cut_that_holds_the_last_state_makes_it_stale() -> None:
    """The paper's law holds what it heard last: after a cut of half a second that is too old."""
    changes = (("case.IV.link", repr([{"on": "inv2 -> inv1", "cut": True, "from_s": 2.0, "to_s": 2.5}])),)
    found = verdict(ran_with((*changes, ("time.end_s", "5.0"))).checked_case, "stale_values")

    assert (found.count, found.violations[0].agent) == (1, "inv1")
    assert found.violations[0].value == pytest.approx(0.5, abs=0.05)


def test_agents_that_rejoin_after_a_cut_pass() -> None:
    """A cut of 0.16 s heals at once; before the limit's time is over the run ends, and it is judged all the same."""
    assert verdict(ran_with(CUT).checked_case, "heal").sentence == "heal passed"


def test_a_split_that_outlasts_its_heal_is_caught() -> None:
    """Agents that never use a state of inv2 after the cut are named, each."""
    case = ran_with(CUT).checked_case
    content = case.content
    decisions = {}
    for agent, entries in content.decisions.items():
        decisions[agent] = [(epoch, deaf(entry)) if entry.tick >= 100 else (epoch, entry) for epoch, entry in entries]
    found = verdict(with_content(case, replace(content, decisions=decisions)), "heal", within_s=1.0)

    assert found.count == 8
    assert all("no new value of inv2 is used after the cut ended at 2.16 s" in one.text for one in found.violations)


@pytest.mark.parametrize(("again_s", "count"), [(2.5, 0), (3.5, 1)])
def test_a_heal_is_judged_by_the_time_until_its_link_is_lost_again(again_s: float, count: int) -> None:
    """Where nothing comes through a cut's end, its link must have been whole for the limit's time to be named."""
    spans = [(1.5, 2.0), (again_s, 3.8)]
    changes = repr([{"on": "inv2 -> inv1", "cut": True, "from_s": a, "to_s": b} for a, b in spans])
    case = ran_with((("case.IV.link", changes), ("time.end_s", "4.5"))).checked_case
    content = case.content
    decisions = {
        agent: [(epoch, deaf(entry) if agent == "inv1" and entry.tick < 180 else entry) for epoch, entry in entries]
        for agent, entries in content.decisions.items()
    }
    found = verdict(with_content(case, replace(content, decisions=decisions)), "heal", within_s=1.0)

    assert [one.text for one in found.violations] == [
        "no new value of inv2 is used after the cut ended at 2 s" for _ in range(count)
    ]


@pytest.mark.parametrize(("until", "count"), [(140, 0), (170, 1)])
def test_the_longest_time_that_both_are_at_work_is_that_of_a_heal(until: int, count: int) -> None:
    """inv1 pauses again and again after a cut: it must use nothing new of inv2 for the limit's time in one piece."""
    pauses = [(2.2, 2.4), (2.5, 2.7), (until * 0.02, 3.9)]
    changes = (
        ("case.IV.link", repr([{"on": "inv2 -> inv1", "cut": True, "from_s": 1.5, "to_s": 2.1}])),
        ("case.IV.node", repr([{"name": "inv1", "pause": True, "from_s": a, "to_s": b} for a, b in pauses])),
        ("time.end_s", "4.5"),
    )
    case = ran_with(changes).checked_case
    content = case.content
    decisions = {
        agent: [(epoch, deaf(entry) if agent == "inv1" and entry.tick >= 75 else entry) for epoch, entry in entries]
        for agent, entries in content.decisions.items()
    }
    found = verdict(with_content(case, replace(content, decisions=decisions)), "heal", within_s=0.65)

    assert found.count == count


def test_a_heal_is_judged_whatever_is_planned_after_the_last_decision() -> None:
    """A cut that is planned for later than anybody decides excuses nobody."""
    spans = [(2.0, 2.16), (4.99, 5.0)]
    changes = repr([{"on": "inv2 -> inv1", "cut": True, "from_s": a, "to_s": b} for a, b in spans])
    case = ran_with((("case.IV.link", changes), ("time.end_s", "5.0"))).checked_case
    content = case.content
    decisions = {
        agent: [(epoch, deaf(entry) if agent == "inv1" and entry.tick >= 100 else entry) for epoch, entry in entries]
        for agent, entries in content.decisions.items()
    }
    found = verdict(with_content(case, replace(content, decisions=decisions)), "heal", within_s=1.0)

    assert [one.agent for one in found.violations] == ["inv1"]


def test_a_heal_is_not_judged_while_its_receiver_is_away() -> None:
    """inv2 leaves when a cut ends and comes back into another one: neither end is held against anybody."""
    links = [
        {"on": "* <-> *", "cut": True, "from_s": 1.94, "to_s": 1.98},
        {"on": "inv6 <-> *", "cut": True, "from_s": 2.28, "to_s": 4.02},
    ]
    changes = {"case.IV.link": links, "time.end_s": 5.5}
    run = gp.load("plug-n-play").replace(changes).run("IV")  # its record goes with it
    found = verdict(run.checked_case, "heal", within_s=1.0)

    assert found.sentence == "heal passed"


def deaf(entry: Any) -> Any:
    """A decision that leaves inv2 out, as a state that was never heard."""
    if "inv2" not in entry.neighbours:
        return entry
    at = entry.neighbours.index("inv2")
    unused = [*(entry.unused or [""] * len(entry.neighbours))]
    unused[at] = "silent"
    states = [*entry.states]
    states[at] = None
    return msgspec.structs.replace(entry, unused=unused, states=states)


def test_an_agent_that_falls_silent_is_caught(sound: CheckedCase) -> None:
    """No event says why: the time of its last state, and how long it was silent."""
    content = sound.content
    states = dict(content.states)
    states["inv7"] = {key: state for key, state in states["inv7"].items() if state.t <= 3.0}
    found = verdict(with_content(sound, replace(content, states=states)), "last_words")

    assert (found.count, found.violations[0].agent, found.violations[0].t) == (1, "inv7", pytest.approx(3.0))
    assert found.violations[0].value == pytest.approx(4.0, abs=0.05)


def test_an_agent_that_never_speaks_is_caught(sound: CheckedCase) -> None:
    """It was configured, and nobody heard of it."""
    states = {name: of for name, of in sound.content.states.items() if name != "inv7"}
    found = verdict(with_content(sound, replace(sound.content, states=states)), "last_words")

    assert found.violations[0].sentence == "never sends a state: inv7 at t = 0.00 s"


def test_an_agent_that_the_scenario_kills_or_lets_leave_is_explained() -> None:
    """The scenario kills inv2; another one lets it leave and return."""
    assert verdict(ran_with(KILLED).checked_case, "last_words").sentence == "last_words passed"
    assert (
        verdict(ran("plug-n-play", next(iter(gp.load("plug-n-play").cases))).checked_case, "last_words").status
        == "passed"
    )


def test_an_agent_that_leaves_without_an_event_is_caught() -> None:
    """The same run whose record lacks the event."""
    case = ran("plug-n-play", next(iter(gp.load("plug-n-play").cases))).checked_case
    found = verdict(replace(case, events=()), "last_words")

    assert found.status == "failed"
    assert found.violations[0].agent == "inv2"


def test_the_pass_over_a_record_agrees_with_its_reader() -> None:
    """States and decisions are those that `RunRecord` has, which makes each again."""
    result = ran_with(LOSSY)
    content, record = result.checked_case.content, result.run_record

    for agent in ("inv1", "inv5"):
        sent = [message.number for message in record.messages(agent, kind="State")]
        assert [state.number for state in content.of_agent(agent)] == sent
    assert dict(content.counts) == record.link_counts()


def in_real_time(case: CheckedCase) -> RecordContent:
    """The record of a case as if it had kept real time, in which every agent heard every state."""
    content = case.content
    info = msgspec.structs.replace(content.info, plant=msgspec.structs.replace(content.info.plant, clock="wall"))
    heard = {(src, dst): dict.fromkeys(content.states[src], "") for src in content.states for dst in content.states}
    return replace(content, info=info, heard={link: of for link, of in heard.items() if link[0] != link[1]})


def test_in_real_time_a_state_that_does_not_arrive_is_caught(sound: CheckedCase) -> None:
    """A number between others that the receiver never noted, and was not rejected either."""
    content = in_real_time(sound)
    (lost,) = (key for key, state in content.states["inv1"].items() if state.number == 150)
    arrived = {key: why for key, why in content.heard["inv1", "inv2"].items() if key != lost}
    wrong = replace(content, heard=dict(content.heard) | {("inv1", "inv2"): arrived})
    found = verdict(with_content(sound, wrong), "message_account")

    assert verdict(with_content(sound, content), "message_account").status == "passed"
    assert (found.count, found.violations[0].agent, found.violations[0].value) == (1, "inv2", 1.0)
    assert found.violations[0].t == pytest.approx(3.0)


def test_in_real_time_nothing_is_missed_while_the_receiver_is_away(sound: CheckedCase) -> None:
    """A process that left and came back owes no account of what was sent meanwhile, nor of its last second."""
    content = in_real_time(sound)
    states = {}
    for (epoch, number), state in content.states["inv2"].items():
        if not 2.0 < state.t < 3.0:
            back = epoch + (state.t >= 3.0)
            states[back, number] = state._replace(epoch=back)
    arrived = {key: "" for key, state in content.states["inv1"].items() if not 1.9 < state.t < 3.1}
    other = replace(content, states=dict(content.states) | {"inv2": states}, heard={("inv1", "inv2"): arrived})

    assert verdict(with_content(sound, other), "message_account").status == "passed"


# ---------------------------------------------------------------- records of any size, and out of order


@pytest.mark.parametrize("changes", [LOSSY, CUT, QUIET], ids=["loss", "cut", "quiet"])
@pytest.mark.parametrize("check", COMMUNICATION)
def test_journals_that_come_late_change_no_verdict(check: str, changes: Changes) -> None:
    """Decisions and verdicts of links come into a record a while after the states that they are about."""
    case = ran_with(changes).checked_case
    at_once, late = (with_content(case, case.content, late=late) for late in (0.0, 2.0))

    assert verdict(at_once, check) == verdict(late, check) == verdict(case, check)


def test_in_real_time_journals_that_come_late_change_no_account(sound: CheckedCase) -> None:
    """Nor do arrivals; a state that did not arrive is missing all the same."""
    content = in_real_time(sound)
    arrived = {key: "" for key, state in content.states["inv1"].items() if state.number % 50}
    wrong = replace(content, heard=dict(content.heard) | {("inv1", "inv2"): arrived})
    at_once, late = (with_content(sound, wrong, late=late) for late in (0.0, 2.0))

    assert verdict(at_once, "message_account") == verdict(late, "message_account")
    assert [one.value for one in verdict(late, "message_account").violations] == [5.0]


def test_a_record_of_any_size_is_judged(sound: CheckedCase, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is too much for the memory of a check of one's own is no reason not to judge a run."""
    monkeypatch.setattr(record_content, "MOST_BYTES", 1000)
    large = replace(sound)

    assert verdict(large, "message_account").status == "passed"
    with pytest.raises(NotJudgedError, match="more than the 0 MB that are taken into memory"):
        _ = large.content


def test_one_time_that_cannot_be_puts_no_account_off(sound: CheckedCase, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing in the file is trusted: its record ends when the run was to end, for every check."""
    monkeypatch.setattr(RecordFile, "t_end", 1e9)
    case = replace(sound)

    assert case.communication.t_end == case.content.t_end == case.content.info.plant.end == 7.0


@pytest.mark.parametrize("clock", ["simulated", "wall"])
def test_the_memory_of_a_pass_does_not_grow_with_the_run(sound: CheckedCase, clock: str) -> None:
    """Three times the run, the same memory: what is done with is forgotten."""
    info = sound.content.info
    info = msgspec.structs.replace(info, plant=msgspec.structs.replace(info.plant, clock=clock))

    def memory(ticks: int) -> int:
        tracemalloc.start()
        sums = SummaryPass(info, ticks * info.T_c)
        for number in range(ticks):
            for agent in NAMES:
                sums.state(agent, SentState(number, number * info.T_c, 1, idle=False, quiet=number % 3 == 1))
                said = [2, 1] if clock == "simulated" else [number - 1, number]
                sums.decision(agent, 1, Decision(number, 0, [n for n in NAMES if n != agent], said, [], []))
                for other in NAMES:
                    if other != agent and number % 3 != 1:
                        sums.heard((other, agent), 1, number, "")
        size, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert sums.finish(0).used
        return size

    assert memory(4500) < 1.1 * memory(1500)


def test_numbers_of_a_later_process_are_not_those_of_an_earlier_one() -> None:
    """In wall-clock time every process counts anew: who is asked about a time gets the one that was there."""
    sent = SentStates(simulated=False)
    for epoch, since in ((1, 0.0), (2, 10.0)):
        for number in range(100):
            assert sent.put(SentState(number, since + 0.02 * number, epoch, idle=False, quiet=False))

    assert sent.window_at(5.0).t(50) == pytest.approx(1.0)
    assert sent.window_at(12.0).t(50) == pytest.approx(11.0)
    assert sent.epochs == {1: (0.0, pytest.approx(1.98)), 2: (10.0, pytest.approx(11.98))}
    assert not sent.put(SentState(50, 1.0, 1, idle=False, quiet=False)), "it came already"


def test_epochs_have_no_order() -> None:
    """A fourth process whose epoch is below those before is kept, the first one is not, and what comes late of it."""
    sent = SentStates(simulated=False)
    for place, epoch in enumerate((7, 9, 8, 3)):
        assert sent.put(SentState(0, 10.0 * place, epoch, idle=False, quiet=False))

    assert [sent.window_of(epoch) is not None for epoch in (7, 9, 8, 3)] == [False, True, True, True]
    assert not sent.put(SentState(1, 0.02, 7, idle=False, quiet=False))
    assert sent.window_at(31.0) is sent.window_of(3)


def test_a_state_is_kept_in_force_as_long_as_nothing_else_is_sent() -> None:
    """By quiet states that follow it without a gap, however many they are; an idle or a lost one ends that."""
    window = StateWindow()
    for number in range(20_000):
        if number != 60:
            window.put(SentState(number, 0.02 * number, 1, idle=number == 40, quiet=number not in (5, 40, 80)))

    assert window.kept_until(80) == 19_999
    assert (window.kept_until(5), window.is_past(5)) == (5, True)
    fresh = StateWindow()
    for number in range(100):
        if number != 60:
            fresh.put(SentState(number, 0.02 * number, 1, idle=number == 40, quiet=number not in (5, 40, 80)))
    assert [fresh.kept_until(number) for number in (5, 41, 80)] == [39, 59, 99]


def test_what_never_arrives_is_counted_where_it_is_too_much_to_keep() -> None:
    """The first and the number of them stay; the last ones stay one by one, as they may still arrive."""
    accounts = ArrivalAccounts(1.5, LINKED_WITHIN)
    accounts.heard(("inv1", "inv2"), 1, 0)
    for number in range(MOST_WAITING + 1000):
        for name in NAMES:
            accounts.state(name, SentState(number, 0.02 * number, 1, idle=False, quiet=False))
    accounts.flush(1e9)
    (account,) = accounts.accounts["inv1", "inv2"]

    assert (account.early.count, account.early.first, len(account.late)) == (999, pytest.approx(0.02), MOST_WAITING)
    accounts.heard(("inv1", "inv2"), 1, MOST_WAITING + 500)
    assert len(account.late) == MOST_WAITING - 1
