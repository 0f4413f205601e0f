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


EVERYBODY = NAMES[:-1]
SOME = ("inv1", "inv2", "inv3", "inv4", "inv6")


@pytest.mark.parametrize(
    ("own", "silent", "names", "longer"),
    [
        ("inv9", EVERYBODY, NAMES, 0.0),
        ("inv1", ("inv9",), NAMES, 1.0),
        ("inv2", ("inv5",), NAMES, 1.0),
        ("inv5", ("inv2",), NAMES, 2.0),
        ("inv5", SOME, NAMES, 0.0),
        ("inv2", ("inv1", "inv3"), NAMES[:3], 0.0),
        ("inv5", (), NAMES[:4], 0.0),
    ],
    ids=["unheard by all", "of all that miss it", "smaller of two", "other of two", "most", "all", "unheard there"],
)
def test_the_agent_with_the_broken_session_opens_a_new_one_first(
    own: str, silent: tuple[str, ...], names: tuple[str, ...], longer: float
) -> None:
    """One new session instead of nine at once; of two that miss only each other the one with the smaller name's."""
    assert lasted(own, silent, names) == pytest.approx(PATIENCE + longer * STAGGER, abs=0.02)
