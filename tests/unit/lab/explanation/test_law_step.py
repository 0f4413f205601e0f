"""The parts of a step: they add up to what was recorded, or it is said that they do not."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import LawChoice
from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.lab.explanation import law_step as module
from gridpeers.lab.explanation.law_step import LawStep, law_step
from gridpeers.scenarios.record.recorded_decision import RecordedDecision
from tests.toy.toy_configs import ALL_FULL, agent_config
from tests.unit.lab.explanation.decisions import decision, neighbour, record_of


class Counting(Law):
    """A law with a memory: its steps grow by 0.001 pu each."""

    def start(self, own: Own) -> None:
        """Begin at no step."""
        self._count = 0

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        """Go on."""
        self._count += 1
        return SetPoints(own.P_set + 0.001 * self._count, own.V_set)


class Wrong(Law):
    """A law whose terms are not numbers."""

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        """Stay."""
        return SetPoints(own.P_set, own.V_set)

    def terms(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> Terms:
        """Name what is no number."""
        return Terms((Term("x", float("nan")),), ())


def of_law(law: Law, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have this law made for an explanation."""
    monkeypatch.setattr(module, "make_law", lambda control: law)


def step_of(decided: RecordedDecision, *before: RecordedDecision) -> LawStep:
    """The step of a decision with those before it."""
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


def test_a_law_that_names_no_terms_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its whole step, which is that of the record."""
    of_law(Counting(), monkeypatch)
    made = decision(restarted=True)
    once = RecordedDecision(**vars(made) | {"state": replace(made.state, P_set=5e4 + 100.0, V_set=277.0)})

    step = step_of(once)

    assert step.problem == ""
    assert [(term.name, pytest.approx(term.value)) for term in step.P_set.terms] == [("step", 0.001)]


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
