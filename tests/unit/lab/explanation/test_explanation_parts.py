"""What became of the states that an agent did not hear, and the parts of a step of its law."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import LawChoice, SharedQuantity
from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.lab.explanation import law_step as module
from gridpeers.lab.explanation.explanation import WORDS, missed, reason, verdicts
from gridpeers.lab.explanation.law_step import LawStep, law_step
from gridpeers.netem.ledger import LinkTrace, Outcome
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from gridpeers.wire.messages import OFF, State
from tests.toy.toy_configs import ALL_FULL, agent_config
from tests.unit.lab.explanation.decisions import decision, neighbour, record_of, state

EVERY = decision(neighbour("inv2", 5), state=None)
NOBODY = record_of(messages=lambda *words, **more: iter(()))


def sent(name: str, *numbers: int, **changes: Any) -> list[State]:
    return [replace(state(name, number), **changes) for number in numbers]


def fate_of(outcome: Outcome, *later: Outcome, **changes: Any) -> str:
    """What is said of the state of tick 6, whose verdict this is, after that of tick 5 was heard."""

    def messages(kind: type[State], name: str, *, since: float, until: float) -> Iterator[State]:
        found = (*sent("inv2", 4, 5), *sent("inv2", 6, **changes))
        return (each for each in found if since - 1e-9 <= each.t <= until + 1e-9)

    count = 1 + len(later)
    trace = LinkTrace("inv2", "inv1", (6,) * count, (0.12,) * count, (outcome, *later))
    others = LinkTrace("inv2", "inv3", (6,), (0.12,), ("cut",)), LinkTrace("inv4", "inv1", (6,), (0.12,), ("cut",))
    another = LinkTrace("inv2", "inv1", (6,), (1.5,), ("partition",))  # of another process, which numbers anew
    record = record_of(messages=messages, links=lambda: (trace, *others, another))
    fates = verdicts(record, "inv1", 0.0, 2.0)
    return missed(record, EVERY, EVERY.neighbours[0], fates, {})


@pytest.mark.parametrize(("outcome", "why"), [
    ("loss", "loss"),
    ("queue", "queue"),
    (0.5, "late"),
    (float("inf"), "kept"),
    (((0.01, 3),), "damaged"),
    (((0.01, 3), (0.5, None)), "late"),
    (((float("inf"), None), (0.01, 3)), "kept"),
])  # fmt: skip
def test_the_verdict_of_the_link_says_why_a_state_was_not_heard(outcome: Outcome, why: str) -> None:
    """Of several copies the sound ones count, of several verdicts the last; other links, and other senders, do not."""
    assert fate_of(outcome) == f"1 state since: 1 {WORDS[why]}"
    assert fate_of("cut", outcome) == fate_of(outcome)


@pytest.mark.parametrize(("changes", "why"), [({"quiet": True}, "quiet"), ({"idle": True}, "idle")])
def test_a_state_that_was_not_meant_to_be_heard_says_so_itself(changes: dict[str, bool], why: str) -> None:
    """Whatever a link did with it."""
    assert fate_of("loss", **changes) == f"1 state since: 1 {WORDS[why]}"


def test_messages_that_were_dropped_unread_are_all_told() -> None:
    """Nobody knows who sent them: as many as the neighbour sent may be its own, and late ones are older ones."""
    record = record_of(messages=lambda *words, **more: iter(sent("inv2", 5, 6, 7)))
    none = record_of(messages=lambda *words, **more: iter(()))
    rejected = {"inv2": [(7, "ghost", 1), (-1, "excess", 500), (-1, "stale", 9)]}

    text = missed(record, EVERY, EVERY.neighbours[0], {}, rejected)
    assert text == (
        '2 states since: 1 rejected as "ghost", 1 rejected as "excess"; 499 messages on its key rejected as "excess"'
    )
    text = missed(none, EVERY, EVERY.neighbours[0], {}, {"inv2": [(-1, "excess", 1)]})
    assert text == 'no state since; 1 message on its key rejected as "excess"'


def test_a_state_with_a_value_beyond_the_range_of_the_law_was_rejected() -> None:
    """The agent that heard it dropped it, unless it did not even come."""
    law = LawChoice(shared=(SharedQuantity(name="x", low=0.0, high=1.0),))
    config = agent_config("inv1", replace(ALL_FULL, law=law))
    decided = RecordedDecision(**vars(EVERY) | {"config": config})
    record = record_of(messages=lambda *words, **more: iter(sent("inv2", 6, 7, shared={"x": 2.0})))

    text = missed(record, decided, decided.neighbours[0], {("inv2", 6): [(0.12, "loss")]}, {})

    assert text == f'2 states since: 1 {WORDS["loss"]}, 1 rejected as "implausible"'


def test_each_reason_has_its_words() -> None:
    """Silent, stale, out of service, of another island by its switches or by its angle, and not new."""
    drifting = replace(
        ALL_FULL, degraded_communication=replace(ALL_FULL.degraded_communication, islands="frequency", max_age=0.1)
    )
    by_switches, by_angle = EVERY, decision(config=agent_config("inv1", drifting), state=None)
    for decided, each, words in (
        (by_switches, neighbour("inv2", None), "no state of it was heard"),
        (by_angle, neighbour("inv2", 2, unused="stale"), "stale: older than max_age = 0.1 s"),
        (by_switches, neighbour("inv2", 9, unused="island"), "in another island: inv1, not inv1"),
        (by_angle, neighbour("inv2", 9, unused="island"), "in another island: its angle drifts"),
        (by_switches, neighbour("inv2", 9, weight=0.0), "its state is not new: weight 0"),
        (by_switches, neighbour("inv2", 9), ""),
    ):
        assert reason(NOBODY, decided, each) == words
    off = neighbour("inv2", 9, unused="island", state=state("inv2", 9, island=OFF))
    assert reason(NOBODY, by_switches, off) == "its inverter is out of service"


def test_a_state_from_before_the_island_changed_is_not_of_another_island() -> None:
    """Both were connected to the grid when it was sent; what kept the later ones back is told beside it."""
    old = neighbour("inv2", 5, unused="island", state=state("inv2", 5, island="grid"))
    words = "its last state is from before the own island changed from grid to inv1"

    for own, told in (("grid", words), ("inv1", "in another island: grid, not inv1")):
        record = record_of(messages=lambda *of, own=own, **more: iter(sent("inv1", 4, 5, island=own)))
        assert reason(record, EVERY, old) == told


# -------------------------------------------------------------------- the step of a law


class Wrong(Law):
    """A law whose terms are not numbers."""

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        return SetPoints(own.P_set, own.V_set, terms=lambda: Terms((Term("x", float("nan")),), ()))


def of_law(law: Law, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "make_law", lambda control: law)


def step_of(decided: RecordedDecision, *before: RecordedDecision) -> LawStep:
    step = law_step(record_of(*before, decided), decided)
    assert step is not None
    return step


@pytest.mark.parametrize("quantity", ["P_set", "V_set"])
@pytest.mark.parametrize("off", [1e-11, -1e-9])
def test_a_step_that_is_off_is_told(quantity: str, off: float) -> None:
    """By more than rounding explains, in either sum: then the step is one term, and it is said why."""
    sound = decision(neighbour("inv2", 9))
    base = 100e3 if quantity == "P_set" else 277.0
    other = replace(sound.state, **{quantity: getattr(sound.state, quantity) + off * base})

    step = step_of(decision(neighbour("inv2", 9), state=other))

    assert step.problem.startswith("computed again, the law makes another step")
    assert [term.name for term in step.P_set.terms] == [term.name for term in step.V_set.terms] == ["step"]
    assert abs(step.P_set.rest) <= 1e-15
    assert abs(step.V_set.rest) <= 1e-15


def test_terms_that_are_no_numbers_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A law of others may name anything; the step is told from the record."""
    of_law(Wrong(), monkeypatch)

    step = step_of(decision())

    assert step.problem == "computed again, the law raised ValueError: a term is nan; it must be a finite number (pu)"


def test_without_a_law_there_is_no_step() -> None:
    """On hold the set-points follow the plant's; a program is not started for an explanation."""
    assert law_step(record_of(), decision(action="hold")) is None
    control = replace(ALL_FULL, law=LawChoice(command=("./mine",)))
    made = decision(neighbour("inv2", 9))
    config = agent_config("inv1", control)
    step = law_step(record_of(), RecordedDecision(**vars(made) | {"config": config}))
    assert step is not None
    assert "is not started for an explanation" in step.problem
