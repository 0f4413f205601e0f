"""The law `resilient` among liars: what W-MSR guarantees, by r-robustness, and what the other defences do."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridpeers.agents.laws.consensus import Consensus
from gridpeers.agents.laws.law import Neighbour, Own, SetPoints
from gridpeers.agents.laws.resilient import Resilient
from gridpeers.lab.predict.closed_form import robustness

T = 0.02


def own(P_set: float = 0.5, Q: float = 0.0, *, t: float = 1.0, e: float = 0.0, name: str = "inv1") -> Own:
    """A follower."""
    return Own(name, False, t, P_set, Q, 1.0, e, 0.05 * Q, P_set, 1.0, 0.01, 0.05, 6e5, 277.0, 60.0)


def neighbour(name: str, P_set: float = 0.5, Q: float = 0.0) -> Neighbour:
    return Neighbour(name, False, T, 1.0, P_set, 1.0, Q, 0.01, 0.05, 6e5)


def graph_of(rng: np.random.Generator, n: int, links: float) -> np.ndarray:
    A = np.triu(rng.random((n, n)) < links, 1).astype(float)
    return np.asarray(A + A.T)


def spread_after(A: np.ndarray, start: np.ndarray, liars: set[int], F: int, said: np.ndarray) -> list[np.ndarray]:
    """Return P_set of all honest agents, step by step; liar i says said[k, i, j] to agent j at step k."""
    n = len(A)
    laws = [Resilient(F=F) for _ in range(n)]
    P = start.copy()
    honest = [i for i in range(n) if i not in liars]
    steps = [P[honest].copy()]
    for row in said:
        new = P.copy()
        for i in honest:
            heard = [neighbour(f"n{j}", row[j, i] if j in liars else P[j]) for j in range(n) if A[i, j]]
            new[i] = laws[i].step(own(P[i]), heard, T).P_set
        P = new
        steps.append(P[honest].copy())
    return steps


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(4, 9), F=st.integers(0, 2), links=st.floats(0.3, 1.0))
def test_w_msr_never_leaves_the_range_of_the_honest_and_they_agree_where_the_graph_is_robust(
    seed: int, n: int, F: int, links: float
) -> None:
    """On any graph with F two-faced liars the range never widens; on a (2F + 1)-robust one it closes."""
    rng = np.random.default_rng(seed)
    A = graph_of(rng, n, links)
    liars = set(rng.choice(n, size=min(F, n - 2), replace=False).tolist())
    said = rng.choice([0.0, 1.0, -1e5, 1e5, 0.4], size=(400, n, n))
    steps = spread_after(A, rng.random(n), liars, F, said)
    lows, highs = [row.min() for row in steps], [row.max() for row in steps]

    assert all(b >= a - 1e-12 for a, b in itertools.pairwise(lows))
    assert all(b <= a + 1e-12 for a, b in itertools.pairwise(highs))
    if robustness(A).least >= 2 * F + 1:
        assert highs[-1] - lows[-1] < 1e-3


def named(decided: SetPoints) -> list[tuple[str, str]]:
    assert decided.terms is not None
    return [(term.name, term.neighbour) for term in decided.terms().P_set]


def test_where_robustness_is_missing_the_honest_may_never_agree() -> None:
    """Two cliques of three linked one to one are 1-robust, enough for F = 0 alone: with F = 1 each keeps its own."""
    A = np.kron(np.eye(2), np.ones((3, 3)) - np.eye(3)) + np.kron(np.array([[0, 1], [1, 0]]), np.eye(3))
    start = np.array([0.2, 0.2, 0.2, 0.8, 0.8, 0.8])
    nobody = np.zeros((400, 6, 6))

    assert robustness(A).F == 0
    assert np.ptp(spread_after(A, start, set(), 1, nobody)[-1]) == pytest.approx(0.6)
    assert np.ptp(spread_after(A, start, set(), 0, nobody)[-1]) < 1e-3


def test_without_defences_it_is_the_paper_s_law() -> None:
    """F = 0 alone gives the paper's step, bit by bit."""
    around = [neighbour("a", 0.9, 0.3), neighbour("b", 0.1, -0.2)]

    assert Resilient(F=0).step(own(0.4, 0.1), around, T)[:4] == Consensus().step(own(0.4, 0.1), around, T)[:4]


def test_a_state_that_no_inverter_can_have_does_not_count() -> None:
    """P_set, the power on droop at the own frequency, or vars are beyond their limits by 0.1 pu."""
    law = Resilient(F=0, tolerance=0.1)

    def counts(n: Neighbour, e: float = 0.0) -> bool:
        return "implausible" not in {name for name, _ in named(law.step(own(e=e), [n], T))}

    assert counts(neighbour("a", 1.05))
    assert not counts(neighbour("a", 1.15))
    assert not counts(neighbour("a", -0.15))
    assert counts(neighbour("a", 0.9))
    assert not counts(neighbour("a", 0.9), e=-0.004)  # it would deliver 1.3 pu
    assert counts(neighbour("a", 0.5, 1.05))
    assert not counts(neighbour("a", 0.5, -1.15))


def test_a_rate_limit_holds_vars_as_well_and_grows_with_the_time_of_silence() -> None:
    """Q of a neighbour moves by 0.01 pu a step at 0.5 pu/s; one that was silent for 0.2 s by 0.1 pu."""

    def V_set(Q: float, silent: int) -> float:
        law = Resilient(F=0, rate=0.5)
        law.step(own(t=1.0), [neighbour("a", Q=0.0)], T)
        for k in range(silent):
            law.step(own(t=1.0 + T * (k + 1)), [], T)
        return law.step(own(t=1.0 + T * (silent + 1)), [neighbour("a", Q=Q)], T).V_set

    for silent, most in ((0, 0.01), (9, 0.1)):
        assert V_set(0.9, silent) == pytest.approx(V_set(most, silent), abs=1e-12)
        assert V_set(0.9, silent) != pytest.approx(V_set(0.9 * most, silent), abs=1e-12)
        assert V_set(-0.9, silent) == pytest.approx(V_set(-most, silent), abs=1e-12)


def test_an_implausible_neighbour_ages_out_and_returns_slowly() -> None:
    """After three times T_out its weight is e^-3; a start forgets it."""
    law, T_out = Resilient(F=0, tolerance=0.1, T_out=0.2), 0.2
    steps = round(3 * T_out / T)
    for k in range(steps):
        law.step(own(t=k * T), [neighbour("a", 5.0)], T)
    full = Resilient(F=0).step(own(), [neighbour("a", 0.6)], T).P_set - 0.5
    trust = 1.0 - (1.0 - math.exp(-3.0)) * math.exp(-T / (10.0 * T_out))
    weighed = Resilient(F=0).step(own(), [neighbour("a", 0.6)._replace(weight=trust)], T).P_set - 0.5

    assert law.step(own(t=steps * T), [neighbour("a", 0.6)], T).P_set - 0.5 == pytest.approx(weighed)
    assert weighed < 0.1 * full
    law.start(own())
    assert law.step(own(t=1.0), [neighbour("a", 0.6)], T).P_set - 0.5 == pytest.approx(full)


@pytest.mark.parametrize(("T_out", "held_back"), [(0.0, False), (0.2, True)])
def test_a_neighbour_that_was_only_ever_implausible_is_held_back_if_it_is_distrusted(
    T_out: float, held_back: bool
) -> None:
    """Nothing of it has counted, so no rate limits its first plausible value; one that lied is no such stranger."""
    law = Resilient(F=0, tolerance=0.1, rate=0.5, T_out=T_out)
    law.step(own(t=1.0), [neighbour("a", 5.0)], T)
    P_set = law.step(own(t=1.0 + T), [neighbour("a", 0.9)], T).P_set
    trusted = 1.0 if not T_out else 1.0 - (1.0 - math.exp(-T / T_out)) * math.exp(-T / (10.0 * T_out))
    expected = neighbour("a", 0.51 if held_back else 0.9)._replace(weight=trusted)

    assert P_set == pytest.approx(Resilient(F=0).step(own(), [expected], T).P_set, abs=1e-12)


def test_distrust_without_a_tolerance_is_refused() -> None:
    """Without a tolerance no state is implausible, so T_out has no effect."""
    with pytest.raises(ValueError, match=r"has T_out = 0\.5 s without a tolerance, so no state is ever implausible"):
        Resilient(T_out=0.5, rate=1.0)


def test_why_names_the_trimmed_and_the_implausible() -> None:
    """They have terms of 0 with their names; the others have the paper's."""
    around = [neighbour("low", 0.1), neighbour("mid", 0.55), neighbour("high", 0.9), neighbour("mad", 50.0)]

    assert named(Resilient(F=1, tolerance=0.1).step(own(0.5), around, T)) == [
        ("power sharing", "mid"),
        ("trimmed", "low"),
        ("trimmed", "high"),
        ("implausible", "mad"),
    ]
