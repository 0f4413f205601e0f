"""What the paper claims of plug-n-play: inverter 2 leaves and returns while the others go on (its section 4)."""

from __future__ import annotations

from functools import partial

from gridpeers.benchmarks import F_BAND, MPSI_BAND, Claim, Findings, Judge
from papers.singhal2022.claims.claim_columns import seconds
from papers.singhal2022.tolerances import AT_ONCE, EQUAL, V_FIGURE, WITHIN

LEAVE, RETURN = "leave", "return"
"""Labels of the events in the scenario."""


def _others_carry(found: Findings) -> tuple[bool, str]:
    t = found.results["IV"][LEAVE].t_load_s
    return t is not None and t <= AT_ONCE.value, f"{LEAVE} {seconds(t)}"


def _restored(event: str) -> Judge:
    def compare(found: Findings) -> tuple[bool, str]:
        t = found.results["IV"][event].t_restore_s
        return t is not None and t <= WITHIN.value, seconds(t)

    return compare


def _shares_again(found: Findings) -> tuple[bool, str]:
    """After the return every inverter, the returned one too, is at the same per-unit power."""
    p = found.results["IV"][RETURN].p.values()
    spread = max(p) - min(p)
    return spread < EQUAL.value, f"p from {min(p):.3f} to {max(p):.3f} pu"


def _voltage(found: Findings) -> tuple[bool, str]:
    errors = {event: found.results["IV"][event].V_error for event in (LEAVE, RETURN)}
    shown = ", ".join(f"{event} {error:.4f} pu" for event, error in errors.items())
    return all(error < V_FIGURE.value for error in errors.values()), shown


SOURCE = "section 4, figures of plug-n-play"

_claim = partial(Claim, source=SOURCE, figure="plug-n-play", cases=("IV",))
"""What all claims of this experiment have in common."""

PLUG_N_PLAY: tuple[Claim, ...] = (
    _claim(
        name="others_carry_its_load",
        text=f"IV: the others carry the load of the one that left within {AT_ONCE.value:g} s",
        events=(LEAVE,),
        judge=_others_carry,
        measures=(),
    ),
    *(
        _claim(
            name=f"restored_after_{event}",
            text=f"IV: abs(f-60) < {F_BAND:g} Hz and MPSI < {MPSI_BAND:g} within {WITHIN.value:g} s of the {event}",
            events=(event,),
            judge=_restored(event),
            measures=(),
        )
        for event in (LEAVE, RETURN)
    ),
    _claim(
        name="shares_again",
        text=f"IV: after the return all powers are equal within {EQUAL.value:g} pu",
        events=(RETURN,),
        judge=_shares_again,
        measures=("p",),
    ),
    _claim(
        name="voltage_likewise",
        text=f"IV: V_error below {V_FIGURE.value:g} pu after both",
        events=(LEAVE, RETURN),
        judge=_voltage,
        measures=("V_error",),
    ),
)
"""Claims of the plug-n-play experiment."""
