"""Whatever a step raises or returns, one line tells it with the time, and what would be right."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Event
from typing import Any

import numpy as np
import pytest

from gridpeers.agents.carriers.time_limit import TimeLimited, limited
from gridpeers.agents.laws.call import LawError, decide
from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints

OWN = Own("inv1", True, 1.2, 0.5, 0.0, 1.0, -0.001, 0.0, 0.5, 1.0, 0.01, 0.05, 6e5, 277.0, 60.0)


class UntoldError(Exception):
    """An error whose text fails."""

    def __str__(self) -> str:
        raise RuntimeError("no text")


class Unshown:
    """An object that cannot be shown."""

    def __repr__(self) -> str:
        raise RuntimeError("no text")


def shares(shared: Any) -> SetPoints:
    return SetPoints(0.5, 1.0, shared)


def raises(error: BaseException) -> Any:
    raise error


@pytest.mark.parametrize(("answer", "said"), [
    (lambda: SetPoints(float("nan"), 1.0), r"returned P_set = nan; it must be a finite number \(pu\)"),
    (lambda: SetPoints("0.5", 1.0), r"returned P_set = '0.5'; it must be a number"),  # type: ignore[arg-type]
    (lambda: SetPoints(0.5, [1.0]), r"returned V_set = \[1.0\]; it must be a number"),  # type: ignore[arg-type]
    (lambda: SetPoints(10**400, 1.0), r"returned P_set = 10{96}...; it must be a number"),
    (lambda: raises(UntoldError()), r"raised UntoldError: its text cannot be read"),
    (Unshown, r"returned a Unshown that cannot be shown; return SetPoints"),
    (lambda: (SetPoints(0.5, 1.0) for _ in "1"), r"returned <generator object .*>>; return "),
    (lambda: SetPoints(0.5, 1.0, {}, np.array([1.0, 2.0])),  # type: ignore[arg-type]
     r"returned SetPoints.*, which raised ValueError: The truth value of an"),
    (lambda: shares(None), r"shares None; share at most 16 numbers by name"),
    (lambda: shares(np.array([1.0, 2.0])), r"shares array\(\[1., 2.\]\); share at most 16 numbers by name"),
    (lambda: shares({f"x{i}": 0.0 for i in range(17)}), r"shares .*; share at most 16 numbers by name"),
    (lambda: shares({"a b": 1.0}), r"shares 'a b'; a name has up to 32 letters, digits and _"),
])  # fmt: skip
def test_a_wrong_decision_is_reported_in_one_line(answer: Callable[[], Any], said: str) -> None:
    """The errors of a class, one by one; `tests/conformance/laws` tests their effect on a run."""

    class Answers(Law):
        def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
            return answer()  # type: ignore[no-any-return]

    with pytest.raises(LawError, match=f"^step at t = 1.2 s {said}") as told:
        decide(TimeLimited(Answers(), 10.0), OWN, (), 0.02)
    assert "\n" not in str(told.value)


def compute_without_end() -> None:
    while True:
        pass


def test_a_call_is_limited_in_processor_time_and_tenfold_in_real_time() -> None:
    """Load on the machine fails no law; a law that computes or waits without end fails."""
    never = Event()
    with limited("it", 0.05, "its limit"):
        never.wait(0.1)

    with pytest.raises(LawError, match="it took longer than its limit"), limited("it", 0.05, "its limit"):
        never.wait()
    with pytest.raises(LawError, match="it took longer than its limit"), limited("it", 0.05, "its limit"):
        compute_without_end()
