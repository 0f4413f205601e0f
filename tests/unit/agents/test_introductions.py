"""How an agent in simulated time gets to know the others, step by step and in whatever order things come."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from agents.agent import Agent
from agents.config import Control, GraphRule
from agents.lockstep.introductions import Ask, Confirm, Hear, Introductions, Peer, Step
from tests.toy.toy_configs import agent_config
from wire.admission import Admission
from wire.codec import RejectedError
from wire.messages import Nameplate, Prepare

B, C = Peer("inv2", "b"), Peer("inv3", "c")
NAMES = ("inv1", "inv2", "inv3", "inv4")


def introductions(graph: GraphRule = "full") -> Introductions:
    """Those of inv1, whose process is "a"."""
    return Introductions(Agent(agent_config("inv1", Control(secondary="all", graph=graph))), "a", Admission())


def plate(name: str, life: int = 1) -> Nameplate:
    """Nameplate of an agent of the toy."""
    return Agent(replace(agent_config(name), incarnation=life)).nameplate


def prepare(number: int, *peers: Peer) -> Prepare:
    """A roster of inv1 and these."""
    names, instances = zip(Peer("inv1", "a"), *peers, strict=True)
    return Prepare(sender="plant", incarnation=1, seq=number, t=0.0, roster=names, instances=instances)


def met(*peers: Peer, graph: GraphRule = "full") -> Introductions:
    """Those of inv1 when it has met these, all proven."""
    made = introductions(graph)
    for peer in peers:
        made.appeared(peer)
        made.answered(peer, plate(peer.name))
        made.answered(peer, plate(peer.name))
    return made


def test_a_subscription_goes_before_the_question_that_proves_it() -> None:
    """Hear, then Ask: on a link that keeps its order the answer shows that the subscription has arrived."""
    made = introductions()

    assert made.appeared(B) == [Ask(B)]
    assert made.answered(B, plate("inv2")) == [Hear("inv2"), Ask(B)]


def test_a_token_that_is_told_twice_is_asked_once() -> None:
    """Each process is asked once for each time its token comes; again only after it had gone."""
    made = introductions()
    made.appeared(B)

    assert made.appeared(B) == []
    made.vanished(B)
    assert made.appeared(B) == [Ask(B)]


def test_who_is_no_neighbour_is_met_and_not_heard() -> None:
    """Its nameplate is enough for being ready."""
    made = introductions("none")
    made.appeared(B)
    made.prepare(prepare(0, B))

    assert made.missing() == ["inv2"]
    assert made.answered(B, plate("inv2")) == [Confirm(0)]


def test_a_ring_waits_for_the_roster() -> None:
    """Who stands beside whom shows only on the roster: before it nobody is listened to."""
    made = introductions("ring")
    peers = [Peer(name, name) for name in NAMES[1:]]
    for peer in peers:
        made.appeared(peer)
        assert made.answered(peer, plate(peer.name)) == []

    assert made.prepare(prepare(0, *peers)) == [Hear("inv2"), Ask(peers[0]), Hear("inv4"), Ask(peers[2])]
    assert made.missing() == ["inv2", "inv4"]
    assert made.answered(peers[0], plate("inv2")) == []
    assert made.answered(peers[2], plate("inv4")) == [Confirm(0)]


def test_a_roster_of_known_neighbours_is_confirmed_at_once() -> None:
    """Nothing is asked again for a new roster, and what comes late is not confirmed twice."""
    made = met(B, C)

    assert made.prepare(prepare(0, B, C)) == [Confirm(0)]
    assert made.prepare(prepare(1, C)) == [Confirm(1)]
    assert made.answered(C, plate("inv3")) == []


def test_a_new_life_of_a_neighbour_must_prove_itself_anew() -> None:
    """Its process is another one; its name is listened to already."""
    made, again = met(B), Peer("inv2", "b2")
    made.prepare(prepare(0, B))
    made.vanished(B)
    made.appeared(again)
    made.prepare(prepare(1, again))

    assert not made.ready
    assert made.answered(again, plate("inv2", life=2)) == [Ask(again)]
    assert made.answered(again, plate("inv2", life=2)) == [Confirm(1)]


def test_a_death_after_being_ready_leaves_it_so() -> None:
    """The next roster tells; until then the dead one's process is only no longer among the living."""
    made = met(B, C)
    made.prepare(prepare(0, B, C))
    assert made.living(("inv2", "inv3")) == {"inv2": "b", "inv3": "c"}

    made.vanished(B)

    assert made.ready
    assert made.living(("inv2", "inv3")) == {"inv3": "c"}


def test_a_token_that_was_lost_and_comes_back_must_prove_itself_anew() -> None:
    """A link that was cut may have lost the subscription; the process is among the living again at once."""
    made = met(B)
    made.prepare(prepare(0, B))
    made.vanished(B)
    made.appeared(B)

    assert made.living(("inv2",)) == {"inv2": "b"}
    assert made.prepare(prepare(1, B)) == []
    assert made.answered(B, plate("inv2")) == [Ask(B)]
    assert made.answered(B, plate("inv2")) == [Confirm(1)]


def test_what_a_process_says_of_itself_is_learnt_once() -> None:
    """Somebody who answers in its place with another nameplate is not believed, and proves nothing."""
    made = introductions()
    made.appeared(B)
    made.answered(B, plate("inv2"))

    with pytest.raises(RejectedError, match="a nameplate never changes") as refused:
        made.answered(B, replace(plate("inv2"), P_rated=1.0))
    assert refused.value.kind == "implausible"
    assert made.prepare(prepare(0, B)) == []
    assert made.answered(B, plate("inv2")) == [Confirm(0)]


def test_a_namesake_changes_nothing() -> None:
    """Of two processes of one name the one on the roster speaks, whatever the other says of itself, before or after."""
    agent, admission = Agent(agent_config("inv1")), Admission()
    made, early, late = Introductions(agent, "a", admission), Peer("inv2", "early"), Peer("inv2", "late")
    for peer, life in ((early, 8), (B, 5)):
        made.appeared(peer)
        made.answered(peer, plate("inv2", life))
    made.appeared(Peer("inv3", "c"))
    made.answered(C, plate("inv3"))
    for peer in (B, C):
        made.answered(peer, plate(peer.name, 5 if peer == B else 1))
    made.prepare(prepare(0, B, C))
    made.appeared(late)
    made.answered(late, replace(plate("inv2", 9), P_rated=1.0))
    assert (made.ready, admission.epoch("inv2")) == (True, 5)

    made.vanished(late)
    made.vanished(early)
    assert admission.epoch("inv2") == 5


def test_a_nameplate_that_comes_after_its_token_is_gone_is_a_ghosts() -> None:
    """Nobody is there any more for whom it could speak."""
    made = introductions()
    made.appeared(B)
    made.vanished(B)

    with pytest.raises(RejectedError) as refused:
        made.answered(B, plate("inv2"))
    assert refused.value.kind == "ghost"


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        (prepare(3, B), "stale"),
        (replace(prepare(4, B), instances=("another", "b")), "unexpected"),
        (replace(prepare(4), roster=("inv2",)), "unexpected"),
    ],
)
def test_a_roster_that_cannot_be_meant_is_refused(message: Prepare, kind: str) -> None:
    """One that is old, of unequal lengths, or without this process changes nothing."""
    made = met(B)
    made.prepare(prepare(3, B))

    with pytest.raises(RejectedError) as refused:
        made.prepare(message)
    assert refused.value.kind == kind
    assert made.roster == 3
    assert made.ready


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["full", "none", "GFM-only", "clustered", "ring"]))
def test_whatever_comes_first_it_is_ready_in_the_end(seed: int, graph: GraphRule) -> None:
    """Tokens and the roster in any order, answers in any order: one Confirm, after a proof from each neighbour."""
    rng, made = random.Random(seed), introductions(graph)
    peers = [Peer(name, name) for name in NAMES[1:]]
    events: list[Peer | Prepare] = [*peers, prepare(0, *peers)]
    rng.shuffle(events)
    asked: list[Peer] = []
    done: list[Step] = []
    while events or asked:
        if events and (not asked or rng.random() < 0.5):
            event = events.pop()
            steps = made.prepare(event) if isinstance(event, Prepare) else made.appeared(event)
        else:
            peer = asked.pop(rng.randrange(len(asked)))
            steps = made.answered(peer, plate(peer.name))
        asked += [step.peer for step in steps if isinstance(step, Ask)]
        done += steps
    rule = Agent(agent_config("inv1", Control(secondary="all", graph=graph)))
    for peer in peers:
        rule.meet(plate(peer.name))
    neighbours = rule.in_neighbours(NAMES)

    assert done[-1] == Confirm(0)
    assert done.count(Confirm(0)) == 1
    assert sorted(step.name for step in done if isinstance(step, Hear)) == sorted(neighbours)
    assert [done.count(Ask(peer)) for peer in peers] == [2 if peer.name in neighbours else 1 for peer in peers]
