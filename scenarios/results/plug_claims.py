"""What the paper claims of plug-n-play: inverter 2 leaves and returns while the others go on (its section 4)."""

from __future__ import annotations

from collections.abc import Callable

from scenarios.results.claims import Claim, Results, Start
from scenarios.results.metrics import F_BAND, MPSI_BAND

LEAVE, RETURN = "leave", "return"
"""Labels of the events in the scenario."""

AT_ONCE = 0.1
"""Time (s) in which the others must carry the load: the GFM take it in one step of the network, then all by droop."""

WITHIN = 1.0
"""Time (s) in which frequency and sharing must be back."""


def _others_carry(results: Results, start: Start) -> tuple[bool, str]:
    t = results["IV"][LEAVE].t_load_s
    return t is not None and t <= AT_ONCE, f"{LEAVE} {_time(t)}"


def _restored(event: str) -> Callable[[Results, Start], tuple[bool, str]]:
    def compare(results: Results, start: Start) -> tuple[bool, str]:
        t = results["IV"][event].t_restore_s
        return t is not None and t <= WITHIN, _time(t)

    return compare


def _shares_again(results: Results, start: Start) -> tuple[bool, str]:
    """After the return every inverter, the returned one too, is at the same per-unit power."""
    p = results["IV"][RETURN].p.values()
    spread = max(p) - min(p)
    return spread < MPSI_BAND, f"p from {min(p):.3f} to {max(p):.3f} pu"


def _voltage(results: Results, start: Start) -> tuple[bool, str]:
    errors = {event: results["IV"][event].V_error for event in (LEAVE, RETURN)}
    shown = ", ".join(f"{event} {error:.4f} pu" for event, error in errors.items())
    return all(error < V_BAND for error in errors.values()), shown


def _time(t: float | None) -> str:
    return "never" if t is None else f"{t:.2f} s"


V_BAND = 0.01
"""Mean voltage error (pu) below which the voltage counts as restored; the paper's figure can be read no finer."""

SOURCE = "section 4, figures of plug-n-play"

PLUG_CLAIMS: tuple[Claim, ...] = (
    Claim(
        name="others_carry_its_load",
        text=f"IV: the others carry the load of the one that left within {AT_ONCE:g} s",
        source=SOURCE,
        cases=("IV",),
        events=(LEAVE,),
        judge=_others_carry,
    ),
    *(
        Claim(
            name=f"restored_after_{event}",
            text=f"IV: abs(f-60) < {F_BAND:g} Hz and MPSI < {MPSI_BAND:g} within {WITHIN:g} s of the {event}",
            source=SOURCE,
            cases=("IV",),
            events=(event,),
            judge=_restored(event),
        )
        for event in (LEAVE, RETURN)
    ),
    Claim(
        name="shares_again",
        text=f"IV: after the return all powers are equal within {MPSI_BAND:g} pu",
        source=SOURCE,
        cases=("IV",),
        events=(RETURN,),
        judge=_shares_again,
    ),
    Claim(
        name="voltage_likewise",
        text=f"IV: V_error below {V_BAND:g} pu after both",
        source=SOURCE,
        cases=("IV",),
        events=(LEAVE, RETURN),
        judge=_voltage,
    ),
)
"""Claims of the plug-n-play experiment."""
