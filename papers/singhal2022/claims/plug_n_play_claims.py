"""The paper's claims on plug-n-play: inverter 2 leaves and returns while the others go on (its section 4)."""

from __future__ import annotations

from gridpeers.benchmarks import F_BAND, MPSI_BAND, Findings
from gridpeers.papers.singhal2022.claims.experiment_claims import ExperimentClaims, listed, seconds
from gridpeers.papers.singhal2022.tolerances import AT_ONCE, EQUAL, V_FIGURE, WITHIN

LEAVE, RETURN = "leave", "return"
"""Labels of the events in the scenario."""

claims = ExperimentClaims(
    "plug-n-play", source="section 4, figures of plug-n-play", figure="plug-n-play", cases=("IV",)
)
_RESTORED = f"IV: abs(f-60) < {F_BAND:g} Hz and MPSI < {MPSI_BAND:g} within {WITHIN.value:g} s of the "


@claims.add(
    f"IV: the others carry the load of the one that left within {AT_ONCE.value:g} s",
    events=(LEAVE,),
)
def others_carry_its_load(found: Findings) -> tuple[bool, str]:
    t = found.results["IV"][LEAVE].t_load_s
    return t is not None and t <= AT_ONCE.value, f"{LEAVE} {seconds(t)}"


@claims.add(f"{_RESTORED}{LEAVE}", events=(LEAVE,))
def restored_after_leave(found: Findings) -> tuple[bool, str]:
    return _restored(found, LEAVE)


@claims.add(f"{_RESTORED}{RETURN}", events=(RETURN,))
def restored_after_return(found: Findings) -> tuple[bool, str]:
    return _restored(found, RETURN)


def _restored(found: Findings, event: str) -> tuple[bool, str]:
    t = found.results["IV"][event].t_restore_s
    return t is not None and t <= WITHIN.value, seconds(t)


@claims.add(
    f"IV: after the return all powers are equal within {EQUAL.value:g} pu",
    events=(RETURN,),
    measures=("p",),
)
def shares_again(found: Findings) -> tuple[bool, str]:
    p = found.results["IV"][RETURN].p.values()  # the returned inverter's too
    return max(p) - min(p) < EQUAL.value, f"p from {min(p):.3f} to {max(p):.3f} pu"


@claims.add(
    f"IV: V_error below {V_FIGURE.value:g} pu after both",
    events=(LEAVE, RETURN),
    measures=("V_error",),
)
def voltage_likewise(found: Findings) -> tuple[bool, str]:
    errors = {event: found.results["IV"][event].V_error for event in (LEAVE, RETURN)}
    holds = all(error < V_FIGURE.value for error in errors.values())
    return holds, listed((event, f"{error:.4f} pu") for event, error in errors.items())
