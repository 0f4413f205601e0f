"""Histories of the catalogue are pinned: nothing moves them but a change of behaviour, with its reason."""

import pytest

from tests.golden.catalogue.pins import cases, environment, read, run_case

PINNED = read()
PINS = PINNED.here()


@pytest.mark.parametrize(("name", "case"), cases())
def test_a_case_gives_the_pinned_history(name: str, case: str) -> None:
    """Every case gives the pinned bytes; in another numerical environment, the pinned last row to 1e-7."""
    pin = run_case(name, case)

    if environment() == PINNED.environment:
        assert pin == PINS[name, case], 'if it should move: python -m tests.golden.catalogue.pin "the reason"'
    else:
        assert pin.last == pytest.approx(PINS[name, case].last, rel=1e-7, abs=1e-4)


def test_every_case_is_pinned_and_nothing_else() -> None:
    """A new case is pinned with its first commit, and a removed one leaves no pin behind."""
    assert set(PINNED.pins) == set(PINS) == set(cases())


def test_every_move_has_a_reason() -> None:
    """Each time the pins moved, somebody said why and which scenarios."""
    assert PINNED.moved
    assert all(len(entry["reason"]) > 20 and entry["scenarios"] for entry in PINNED.moved)
