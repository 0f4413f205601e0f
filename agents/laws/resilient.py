r"""The paper's law among liars: trimmed means (W-MSR), plausibility, rate limits, and distrust. Pure.

H. J. LeBlanc, H. Zhang, X. Koutsoukos, S. Sundaram, "Resilient Asymptotic Consensus in Robust Networks", IEEE J. Sel.
Areas Commun. 31(4), 2013: each agent leaves out the F largest of the neighbours' values above its own (all, if there
are fewer), and the F smallest below it, and averages over the rest. Here that holds for m_p P_set in (12), (13) and for
m_q q in (14), (15), each by itself. The leaders' own errors stay as they are: nobody can lie about them.

**Claim of the paper.** With at most F liars among the neighbours of each honest agent, consensus never leaves the range
of the honest agents' values, on any graph. They agree if the graph is (2F + 1)-robust; `gridpeers predict` has r.

Three defences of gridpeers come before the trimming, each off at 0: `tolerance`, `rate` and `T_out`.
All inverters of an island see one frequency, so a neighbour on its droop delivers p_j = P_set,j - e/m_p,j, e being the
own frequency error: by that it is plausible or not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp
from typing import Annotated, Any, NamedTuple

from gridpeers.agents.laws.consensus import Consensus
from gridpeers.agents.laws.law import Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.schema.table_schema import Range, Unit

SLOWER = 10.0  # Ratio of the times in which trust returns and in which it falls


class _Memory(NamedTuple):
    t: float
    """Run time (s) of the last step with it."""
    P_set: float
    """P_set that counted (pu)."""
    Q: float
    """Q that counted (pu)."""
    trust: float
    """From 0 to 1."""


class Resilient(Consensus):
    """The paper's law with trimmed means (W-MSR) and checks of plausibility, against neighbours that lie."""

    source = "LeBlanc et al., IEEE J. Sel. Areas Commun. 31(4), 2013"

    F: Annotated[int, Range(0, 100), "Largest number of liars among the neighbours of an agent; 0 trims none."] = 1
    tolerance: Annotated[float, Unit("pu"), Range(0, 100), "Excess over a limit that is implausible; 0: off."] = 0.0
    rate: Annotated[float, Unit("pu/s"), Range(0, 1e6), "Fastest change of a neighbour's value; 0: any."] = 0.0
    T_out: Annotated[float, Unit("s"), Range(0, 1e3), "Time in which trust in an implausible one falls; 0: off."] = 0.0

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        if self.T_out and not self.tolerance:
            raise ValueError(
                f"has T_out = {self.T_out:g} s without a tolerance, so no state is ever implausible; give "
                "tolerance, e.g. 0.1 (pu), or leave T_out out"
            )
        self._memory: dict[str, _Memory] = {}

    def start(self, own: Own) -> None:
        self._memory = {}

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        believed, self._memory = self._believed(own, neighbours, T)
        of_P, of_V = (self._trimmed(believed, *of) for of in self._values(own))
        P, V = super().step(own, of_P, T), super().step(own, of_V, T)

        def terms() -> Terms:
            """Return the paper's terms of those that remain, and for those left out a term of 0 with the reason."""
            assert P.terms is not None
            assert V.terms is not None
            why_P, why_V = (_left_out(neighbours, believed, rest) for rest in (of_P, of_V))
            return Terms((*P.terms().P_set, *why_P), (*V.terms().V_set, *why_V))

        return SetPoints(P.P_set, V.V_set, terms=terms)

    @staticmethod
    def _values(own: Own) -> tuple[tuple[float, Callable[[Neighbour], float]], ...]:
        return (own.m_p * own.P_set, lambda n: n.m_p * n.P_set), (own.z, lambda n: n.m_q * n.Q)

    def _trimmed(
        self, neighbours: Sequence[Neighbour], own: float, value: Callable[[Neighbour], float]
    ) -> list[Neighbour]:
        """Return the neighbours without the F largest values above the own one and the F smallest below it."""
        if not self.F:
            return list(neighbours)
        order = sorted(range(len(neighbours)), key=lambda i: value(neighbours[i]))
        below = [i for i in order if value(neighbours[i]) < own][: self.F]
        above = [i for i in order if value(neighbours[i]) > own][-self.F :]
        out = {*below, *above}
        return [other for i, other in enumerate(neighbours) if i not in out]

    def _believed(
        self, own: Own, neighbours: Sequence[Neighbour], T: float
    ) -> tuple[list[Neighbour], dict[str, _Memory]]:
        """Return the plausible neighbours with the values that count, and the memory of all."""
        if not (self.tolerance or self.rate):
            return list(neighbours), self._memory
        believed, memory = [], dict(self._memory)
        for n in neighbours:
            plausible = self._is_plausible(own, n)
            last = self._memory.get(n.name)
            trust = 1.0 if last is None else last.trust
            if self.T_out:
                trust = (
                    1.0 - (1.0 - trust) * exp(-T / (SLOWER * self.T_out)) if plausible else trust * exp(-T / self.T_out)
                )
            if not plausible:
                if last is not None:
                    memory[n.name] = last._replace(trust=trust)
                elif self.T_out:
                    memory[n.name] = _Memory(own.t, own.P_set, own.Q, trust)
                continue
            P_set, Q = n.P_set, n.Q
            if self.rate and last is not None:
                most = self.rate * max(T, own.t - last.t)
                P_set = min(max(P_set, last.P_set - most), last.P_set + most)
                Q = min(max(Q, last.Q - most), last.Q + most)
            memory[n.name] = _Memory(own.t, P_set, Q, trust)
            believed.append(n._replace(P_set=P_set, Q=Q, weight=n.weight * trust))
        return believed, memory

    def _is_plausible(self, own: Own, n: Neighbour) -> bool:
        if not self.tolerance:
            return True
        low, high = self.P_set_min - self.tolerance, self.P_set_max + self.tolerance
        P = n.P_set - own.e / n.m_p
        return low <= n.P_set <= high and low <= P <= high and abs(n.Q) <= 1.0 + self.tolerance


def _left_out(neighbours: Sequence[Neighbour], believed: Sequence[Neighbour], rest: Sequence[Neighbour]) -> list[Term]:
    """Return a term of 0 for each neighbour that does not count, named after the reason."""
    plausible, counts = {n.name for n in believed}, {n.name for n in rest}
    trimmed = [Term("trimmed", 0.0, n.name) for n in believed if n.name not in counts]
    return trimmed + [Term("implausible", 0.0, n.name) for n in neighbours if n.name not in plausible]
