"""The terms that a law names are its step: with the limits they add up, at every input."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridpeers.agents.carriers.law_registry import LAWS
from gridpeers.agents.laws.call import LawError, decide
from gridpeers.agents.laws.law import Law, Neighbour, Own, Term, Terms
from gridpeers.wire.plain_sum import plain_sum

NAMES = ("consensus", "dapi", "event-triggered", "finite-time", "centralised", "resilient")

VARIANTS: dict[str, tuple[dict[str, float | str], ...]] = {
    "consensus": ({}, {"kappa_c": 12.0}, {"alpha_min": 0.1, "V_full": 0.02}, {"P_set_max": 0.6, "V_set_max": 1.01}),
    "dapi": ({}, {"P_set_min": 0.4, "V_set_min": 0.99}),
    "event-triggered": ({}, {"P_set_max": 0.6}, {"c_0": 0.01, "q_0": 0.01}),
    "finite-time": ({}, {"gamma": 0.9, "P_set_max": 0.6}),
    "centralised": ({}, {"centre": "inv2"}, {"P_set_max": 0.6, "V_set_max": 1.01}),
    "resilient": ({}, {"F": 2, "tolerance": 0.2, "T_out": 0.1}, {"F": 0, "rate": 0.5, "T_out": 0.1, "tolerance": 0.1}),
}
"""Parameters of each law."""


@st.composite
def owns(draw: st.DrawFn) -> Own:
    m_q = draw(st.floats(0.01, 0.1))
    Q = draw(st.floats(-1.0, 1.0))
    return Own(
        name="inv1", leader=draw(st.booleans()), t=draw(st.floats(0.0, 100.0)), P=draw(st.floats(-1.0, 1.0)), Q=Q,
        V=draw(st.floats(0.8, 1.2)), e=draw(st.floats(-0.05, 0.05)), z=m_q * Q, P_set=draw(st.floats(0.0, 1.0)),
        V_set=draw(st.floats(0.9, 1.1)), m_p=draw(st.floats(0.005, 0.05)), m_q=m_q, P_rated=6e5, V_nom=277.0,
        f_nom=60.0, P_saturated=draw(st.sampled_from((-1, 0, 1))), V_saturated=draw(st.sampled_from((-1, 0, 1))),
    )  # fmt: skip


@st.composite
def neighbours(draw: st.DrawFn, name: str) -> Neighbour:
    shared = draw(
        st.sampled_from(
            ({}, {"v": 1.02}, {"omega": 0.002}, {"omega": 0.006, "E": 0.01}, {"v": 0.97, "omega": -0.001, "E": -0.02})
        )
    )
    return Neighbour(
        name=name, leader=draw(st.booleans()), age=draw(st.floats(0.0, 5.0)),
        weight=draw(st.sampled_from((0.0, 1e-3, 0.4, 1.0))), P_set=draw(st.floats(0.0, 1.0)),
        V_set=draw(st.floats(0.9, 1.1)), Q=draw(st.floats(-1.0, 1.0)), m_p=draw(st.floats(0.005, 0.05)),
        m_q=draw(st.floats(0.01, 0.1)), P_rated=3.5e5, shared=shared,
    )  # fmt: skip


@st.composite
def inputs(draw: st.DrawFn) -> tuple[Own, tuple[Neighbour, ...], float]:
    count = draw(st.integers(0, 4))
    return draw(owns()), tuple(draw(neighbours(f"inv{k + 2}")) for k in range(count)), draw(st.floats(1e-3, 0.1))


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_terms_and_limits_add_up_to_the_step(name: str, data: st.DataObject) -> None:
    """Over several steps, so that a memory counts: the set-point before, the terms and the limits give the result."""
    law = LAWS.resolve(name, "")(**data.draw(st.sampled_from(VARIANTS[name])))
    steps = data.draw(st.lists(inputs(), min_size=1, max_size=4))
    law.start(steps[0][0])
    P_set, V_set = steps[0][0].P_set, steps[0][0].V_set
    for own, others, T in steps:
        own = own._replace(P_set=P_set, V_set=V_set)
        result = decide(law, own, others, T)
        assert result.terms is not None
        terms = result.terms()
        P = P_set + sum(term.value for term in terms.P_set)
        V = V_set + sum(term.value for term in terms.V_set)
        assert min(max(P, law.P_set_min), law.P_set_max) == pytest.approx(result.P_set, rel=0.0, abs=1e-12)
        assert min(max(V, law.V_set_min), law.V_set_max) == pytest.approx(result.V_set, rel=0.0, abs=1e-12)
        assert {term.neighbour for term in (*terms.P_set, *terms.V_set)} <= {"", *(other.name for other in others)}
        P_set, V_set = result.P_set, result.V_set


class Summed(Law):
    """A law that states its step as terms."""

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> Terms:
        return Terms((Term("a", 0.1), Term("b", 0.2, "inv2")), (Term("c", 1),), {"x": 2.0}, send=False)


def test_terms_add_up_alike_on_every_python() -> None:
    """A compensated sum, as `sum` is since Python 3.12, gives 1."""
    assert plain_sum([1e16, 1.0, -1e16]) == 0.0


def test_terms_alone_are_a_step() -> None:
    """The agent adds the terms to the set-points and limits the sums."""
    own = Own("inv1", True, 1.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.01, 0.05, 6e5, 277.0, 60.0)

    decided = decide(Summed(), own, (), 0.02)

    assert decided[:4] == (0.5 + (0.1 + 0.2), 1.1, {"x": 2.0}, False)
    assert decided.terms is not None
    assert decided.terms() == Summed().step(own, (), 0.02)


def test_a_term_that_is_no_number_is_named() -> None:
    class Wrong(Summed):
        def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> Terms:
            return Terms((Term("pull", float("nan")),))

    own = Own("inv1", True, 1.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.01, 0.05, 6e5, 277.0, 60.0)

    with pytest.raises(LawError, match="step at t = 1 s returned term 'pull' = nan; it must be a finite number"):
        decide(Wrong(), own, (), 0.02)
