"""Why there is no proposal for a feeder, and what to change."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

from gridpeers.plant.equipment import InverterRow


class NoProposalError(ValueError):
    """A feeder that cannot be islanded as it is; the text says what to add."""


class NoSwitchError(NoProposalError):
    """No switch cuts half of the load off the substation.

    Attributes
    ----------
    lines : tuple of str
        Lines near the substation that would make switches.
    """

    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = tuple(lines)
        hint = (
            f"name a line to be one, such as {', '.join(lines)}" if lines else "no single three-phase line does either"
        )
        super().__init__(f"no switch cuts half of the load off the substation; {hint}")


class TooLargeError(NoProposalError):
    """An inverter would be larger than its voltage allows."""

    def __init__(self, row: InverterRow, most: float, load: float, count: int) -> None:
        self.needed = ceil(count * row.P_rated / most)
        """Inverters that may be enough."""
        super().__init__(
            f"{count} inverters for the load of {load / 1e3:.0f} kW need one of {row.P_rated / 1e3:.0f} kW at bus "
            f"{row.bus}, where {most / 1e3:.0f} kW are plausible; give more --inverters, if there are buses for "
            "them, or another --switch"
        )
