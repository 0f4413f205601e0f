"""Which of two agents that do not hear each other opens a new session, and when."""

from __future__ import annotations

import pytest

from gridpeers.agents.session_health import STAGGER, SessionHealth
from gridpeers.wire.timing import PATIENCE

NAMES = tuple(f"inv{i}" for i in range(1, 10))


def lasted(own: str, silent: tuple[str, ...], names: tuple[str, ...] = NAMES) -> float:
    health = SessionHealth(own)
    others = tuple(name for name in names if name != own)
    for k in range(2000):
        now = 0.01 * k
        for name in ("plant", *others):
            if name not in silent:
                health.came(name, now)
        if health.problem(names, met=others, neighbours=others, now=now):
            return now
    return float("inf")


def test_an_agent_that_nobody_hears_goes_before_all_others() -> None:
    """inv9 misses eight, each of them misses inv9 alone: one new session instead of nine at once."""
    everybody = tuple(name for name in NAMES if name != "inv9")
    assert lasted("inv9", everybody) == pytest.approx(PATIENCE, abs=0.02)
    for name in everybody:
        assert lasted(name, ("inv9",)) >= PATIENCE + STAGGER


def test_of_two_that_miss_only_each_other_the_one_with_the_smaller_name_goes_first() -> None:
    """The other one follows, should that not help."""
    assert lasted("inv2", ("inv5",)) == pytest.approx(PATIENCE + STAGGER, abs=0.02)
    assert lasted("inv5", ("inv2",)) == pytest.approx(PATIENCE + 2.0 * STAGGER, abs=0.02)


def test_who_misses_more_than_half_of_the_others_or_is_unheard_waits_no_longer() -> None:
    """Its own session is to blame."""
    assert lasted("inv5", ("inv1", "inv2", "inv3", "inv4", "inv6")) == pytest.approx(PATIENCE, abs=0.02)
    assert lasted("inv2", ("inv1", "inv3"), ("inv1", "inv2", "inv3")) == pytest.approx(PATIENCE, abs=0.02)
    health = SessionHealth("inv5")
    for k in range(2000):
        for name in ("plant", *NAMES):
            health.came(name, 0.01 * k)
        if health.problem(NAMES[:4], met=NAMES, neighbours=NAMES, now=0.01 * k):
            assert 0.01 * k == pytest.approx(PATIENCE, abs=0.02)
            return
    pytest.fail("it keeps the session in which the plant does not hear it")
