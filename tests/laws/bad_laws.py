"""Laws that a user may write by mistake."""

from __future__ import annotations

from typing import Annotated, Any

import gridpeers as gp


class Failing(gp.Law):
    """Holds its set-points, and fails from the tenth step on as it is told."""

    how: str = ""
    gain: Annotated[float, gp.Unit("1/s"), gp.Range(0, 100), "Does nothing."] = 5.0

    def start(self, own: gp.Own) -> None:
        """Count from zero."""
        self.steps = 0

    def step(self, own: gp.Own, neighbours: Any, T: float) -> Any:
        """Hold, or fail."""
        self.steps += 1
        if self.steps < 10:
            return gp.SetPoints(own.P_set, own.V_set)
        match self.how:
            case "raises":
                return 1 / 0
            case "nan":
                return gp.SetPoints(float("nan"), 1.0)
            case "nothing":
                return None
            case "text":
                return gp.SetPoints("0.5", [1.0])  # type: ignore[arg-type]
            case "hangs":
                while True:
                    pass
            case "shares too much":
                return gp.SetPoints(0.5, 1.0, {f"x{i}": 0.0 for i in range(17)})
            case "shares a sentence":
                return gp.SetPoints(0.5, 1.0, {"a b": 1.0})
        raise AssertionError(self.how)


class NoStep(gp.Law):
    """Has no step."""


class WrongStep(gp.Law):
    """Takes no neighbours."""

    def step(self, own: gp.Own) -> gp.SetPoints:  # type: ignore[override]
        """Hold."""
        return gp.SetPoints(own.P_set, own.V_set)


class Unmakeable(gp.Law):
    """Fails while it is made."""

    def __init__(self, **parameters: Any) -> None:
        raise RuntimeError("no licence")

    def step(self, own: gp.Own, neighbours: Any, T: float) -> gp.SetPoints:
        """Hold."""
        return gp.SetPoints(own.P_set, own.V_set)


def no_class() -> None:
    """Is no law."""
