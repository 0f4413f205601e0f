"""The branches of a load or generator of an OpenDSS circuit: one a phase, to the neutral or around the delta."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

from gridpeers.bridges.opendss.dss_elements import letter_of


class Branches(NamedTuple):
    """The branches of an element, between its conductors."""

    bus: str
    """Bus of its terminal."""
    letters: list[str]
    """Letter of the node that each conductor leads to; empty for ground."""
    conductors: list[tuple[int, int]]
    """The two conductors of each branch."""
    V_nom: float
    """Nominal voltage across each (V)."""

    def ends(self) -> list[tuple[str, str]]:
        """Return the ends of each branch as `LoadPart` has them; none of a branch with both ends at one node."""
        pairs = [(self.letters[start], self.letters[end]) for start, end in self.conductors]
        return [(one, other) if one else (other, one) for one, other in pairs if one != other]


def branches_of(element: Any, kV: float, *, is_delta: bool) -> Branches:
    """Return the branches of a load or generator.

    Parameters
    ----------
    element : dss.ICktElement
        The element, active.
    kV
        Its property `kV`: line-to-line in a delta and where a wye has two or three phases, else that of its phase.
    is_delta
        Whether its phases stand between its conductors, and not between each and the last one.
    """
    phases, conductors = int(element.NumPhases), int(element.NumConductors)
    return Branches(
        bus=str(element.BusNames[0]).partition(".")[0].lower(),
        letters=[letter_of(node) for node in element.NodeOrder],
        conductors=[(k, (k + 1) % conductors if is_delta else phases) for k in range(phases)],
        V_nom=kV * 1e3 / sqrt(3.0) if not is_delta and phases in (2, 3) else kV * 1e3,
    )
