"""Membership: the process of each name, its nameplate, and the messages that count."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.wire.codec import RejectedError
from gridpeers.wire.membership import ASKED_AT_ONCE, MOST_PROCESSES, Admission, Membership
from gridpeers.wire.messages import MOST_INVERTERS, Nameplate, State
from tests.toy.toy_configs import agent_config


def nameplate(name: str = "inv2", epoch: int = 1) -> Nameplate:
    return Agent(replace(agent_config(name), epoch=epoch)).nameplate


def members(*instances: str) -> tuple[Membership, Admission]:
    admission = Admission()
    made = Membership(admission)
    for number, instance in enumerate(instances):
        made.appeared("inv2", instance)
        made.meet(instance, nameplate(epoch=number + 1))
    return made, admission


def test_of_two_processes_of_a_name_the_first_counts_until_it_is_gone() -> None:
    """Then the other process counts, in its own epoch, without a further question."""
    made, admission = members("a", "b")
    assert (made.instance("inv2"), admission.epochs.get("inv2")) == ("a", 1)

    assert made.vanished("inv2", "a")
    assert (made.instance("inv2"), admission.epochs.get("inv2")) == ("b", 2)
    assert made.nameplates["inv2"].epoch == 2
    assert made.vanished("inv2", "b")
    assert (made.instance("inv2"), admission.epochs.get("inv2"), made.nameplates) == ("", None, {})


def test_a_roster_says_which_of_two_processes_counts() -> None:
    """Whichever came first, and also if its token comes later."""
    made, admission = members("a", "b")
    made.prefer("inv2", "b")
    assert (made.instance("inv2"), admission.epochs.get("inv2")) == ("b", 2)

    made.prefer("inv2", "c")
    assert made.instance("inv2") == "b"
    assert made.appeared("inv2", "c")
    assert admission.epochs.get("inv2") is None
    assert made.meet("c", nameplate(epoch=7))
    assert admission.epochs.get("inv2") == 7


def test_what_a_process_says_of_itself_never_changes() -> None:
    """Another nameplate in its place is refused, and changes nothing."""
    made, _ = members("a")

    with pytest.raises(RejectedError, match="a nameplate never changes") as refused:
        made.meet("a", replace(nameplate(), P_rated=1.0))
    assert refused.value.kind == "implausible"
    assert made.nameplates["inv2"] == nameplate()


@given(st.integers(0, 2**32 - 1))
def test_the_process_that_counts_is_there_and_its_nameplate_is_its_own(seed: int) -> None:
    """In any order of messages, nameplate and epoch of a name are those of one process whose token is there."""
    rng, admission = random.Random(seed), Admission()
    made, there = Membership(admission), set[str]()
    for _ in range(40):
        instance = rng.choice("abc")
        match rng.randrange(4):
            case 0:
                made.appeared("inv2", instance)
                there.add(instance)
            case 1:
                made.vanished("inv2", instance)
                there.discard(instance)
            case 2:
                made.prefer("inv2", instance)
            case 3 if instance in there:
                made.meet(instance, nameplate(epoch=ord(instance)))
        counts = made.instance("inv2")
        known = made.nameplates.get("inv2")

        assert (counts in there) if there else counts == ""
        assert known is None or known.epoch == admission.epochs.get("inv2")
        assert known is None or chr(known.epoch) in there


def test_tokens_of_anybody_cost_no_more_than_so_many_questions() -> None:
    """A few processes of each name are noted, and as many names as a run may have. The first ones still count."""
    made, _ = members("a")
    for i in range(1_000):
        for name in ("inv2", f"who{i}"):
            if made.has_room(name):
                made.appeared(name, f"x{i}")
    asked = [made.next_unmet() for _ in range(100)]
    noted = {process for each in asked for process in each}

    assert made.instance("inv2") == "a"
    assert sum(name == "inv2" for name, _ in noted) == MOST_PROCESSES - 1
    assert len({name for name, _ in noted}) == MOST_INVERTERS
    assert max(map(len, asked)) == ASKED_AT_ONCE


def state(seq: int, epoch: int = 5, name: str = "inv2") -> State:
    return State(sender=name, epoch=epoch, seq=seq, t=min(0.02 * seq, 1e9), P_set=0.0, V_set=0.0, Q=0.0)


def bound(*epochs: int) -> Admission:
    admission = Admission()
    for epoch in epochs:
        admission.release("inv2")
        admission.bind("inv2", epoch)
    return admission


def refusal(admission: Admission, message: State) -> str:
    try:
        admission.check(message)
    except RejectedError as rejected:
        return rejected.kind
    return ""


@pytest.mark.parametrize("epochs", [(5,), (4, 5), (9, 5)])
def test_the_epoch_of_the_process_that_is_there_counts_and_no_other(epochs: tuple[int, ...]) -> None:
    """A greater epoch means nothing: the clock of the new process may be ahead or behind."""
    admission = bound(*epochs)

    assert refusal(admission, state(0, 5)) == ""
    assert {refusal(admission, state(0, epoch)) for epoch in (0, 4, 6, 9, 2**53 - 1)} == {"ghost"}
    assert refusal(admission, state(0, 5, "inv3")) == "unexpected"


def test_who_is_gone_is_a_ghost_until_it_is_back() -> None:
    """After a token is lost and returns, the numbers of its messages continue."""
    admission = bound(5)
    assert admission.take(state(7)) == 0
    assert admission.passes(state(7))
    admission.release("inv2")
    assert refusal(admission, state(8)) == "ghost"
    assert not admission.passes(state(8))
    admission.bind("inv2", 5)

    assert refusal(admission, state(8)) == ""
    assert not admission.passes(state(7))
    with pytest.raises(RejectedError, match="after 7"):
        admission.take(state(7))
    assert admission.take(state(10)) == 2
