"""Laws that a user may write by problem."""

from __future__ import annotations

import contextlib
import sys
from typing import Annotated, Any

import gridpeers as gp


class Failing(gp.Law):
    """Holds its set-points, and fails from the tenth step on as it is told."""

    how: str = ""
    gain: Annotated[float, gp.Unit("1/s"), gp.Range(0, 100), "Does nothing."] = 5.0

    def start(self, own: gp.Own) -> None:
        self.steps = 0

    def step(self, own: gp.Own, neighbours: Any, T: float) -> Any:
        self.steps += 1
        if self.steps < 10:
            return gp.SetPoints(own.P_set, own.V_set)
        match self.how:
            case "raises":
                return 1 / 0
            case "nothing":
                return None
            case "leaves":
                sys.exit(3)
            case "hangs in spite of all":
                while True:
                    with contextlib.suppress(Exception):
                        while True:
                            pass
        raise AssertionError(self.how)


class WrongStep(gp.Law):
    """Takes no neighbours."""

    def step(self, own: gp.Own) -> gp.SetPoints:  # type: ignore[override]
        return gp.SetPoints(own.P_set, own.V_set)


class Unmakeable(gp.Law):
    """Fails while it is made."""

    def __init__(self, **parameters: Any) -> None:
        raise RuntimeError("no licence")

    def step(self, own: gp.Own, neighbours: Any, T: float) -> gp.SetPoints:
        return gp.SetPoints(own.P_set, own.V_set)


def no_class() -> None:
    """Is no law."""


class Held(gp.Law):
    """Holds its set-points."""

    def step(self, own: gp.Own, neighbours: Any, T: float) -> gp.SetPoints:
        return gp.SetPoints(own.P_set, own.V_set)


class NeverMade(Held):
    """Is never made."""

    def __init__(self, **parameters: Any) -> None:
        while True:
            pass


class NamedAsAKey(Held):
    """Has a parameter that no scenario can give."""

    folder: str = ""
