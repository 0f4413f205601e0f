"""What the paper claims of intermittency: three inverters lose power, the others take over (section 4, Table III)."""

from __future__ import annotations

from functools import partial

from gridpeers.benchmarks import Claim, Findings
from papers.singhal2022.claims.claim_columns import near_relatively, near_the_table
from papers.singhal2022.tolerances import AT_LIMIT, EQUAL, F_NONE, HEADROOM_GONE, MQSI_UNMOVED

CLOUDS = "clouds"
"""Label of the event in the scenario."""

FEASIBLE = ("350kW", "275kW", "250kW", "225kW", "200kW")
"""Cases of Table III."""

CUT = FEASIBLE[1:]
"""Those of them in which power is really lost."""

INFEASIBLE = "175kW"
"""Below the table's last column: the others have not enough left."""

SOURCE = "section 4, Table III and figure"


def _at_the_limit(found: Findings) -> tuple[bool, str]:
    off = max(
        (
            abs(found.results[case][CLOUDS].p[name] - limit)
            for case in CUT
            for name, limit in found.available[case].items()
        ),
        default=float("inf"),
    )
    return off < AT_LIMIT.value, f"at most {off:.4f} pu off their limits"


def _others_take_over(found: Findings) -> tuple[bool, str]:
    spread, f_error = 0.0, 0.0
    for case in CUT:
        steady = found.results[case][CLOUDS]
        others = [p for name, p in steady.p.items() if name not in found.available[case]]
        spread, f_error = max(spread, max(others) - min(others)), max(f_error, steady.f_error_Hz)
    times = [found.settled[case][CLOUDS].t_f_s for case in CUT]
    slowest = max((t for t in times if t is not None), default=float("nan"))
    holds = spread < EQUAL.value and f_error < F_NONE.value and None not in times
    return holds, f"the others within {spread:.4f} pu of each other, f back within {slowest:.2f} s"


def _MQSI_unmoved(found: Findings) -> tuple[bool, str]:
    values = [found.results[case][CLOUDS].MQSI for case in FEASIBLE]
    return max(values) - min(values) < MQSI_UNMOVED.value, f"MQSI from {min(values):.3f} to {max(values):.3f}"


def _infeasible(found: Findings) -> tuple[bool, str]:
    steady = found.results[INFEASIBLE][CLOUDS]
    others = [p for name, p in steady.p.items() if name not in found.available[INFEASIBLE]]
    holds = steady.f_error_Hz > HEADROOM_GONE.value and min(others) > 1.0 - EQUAL.value
    return holds, f"the others at {min(others):.3f} pu or more, abs(f-60) {steady.f_error_Hz:.2f} Hz and growing"


_claim = partial(Claim, events=(CLOUDS,))
"""What all claims of this experiment have in common, but for those about a whole column of a table."""

INTERMITTENCY: tuple[Claim, ...] = (
    near_the_table("intermittency", "III", "MPSI"),
    near_the_table("intermittency", "III", "f_error_Hz"),
    near_the_table("intermittency", "III", "V_error"),
    near_relatively("intermittency", "III"),
    _claim(
        name="saturated_at_their_limit",
        text="inverters 2, 5 and 8 give what they have",
        source=SOURCE,
        figure="intermittency",
        cases=CUT,
        judge=_at_the_limit,
        measures=("p",),
    ),
    _claim(
        name="others_take_over",
        text="the others take over alike, and 60 Hz returns",
        source=SOURCE,
        figure="intermittency",
        cases=CUT,
        judge=_others_take_over,
        measures=("f_error_Hz", "p"),
    ),
    _claim(
        name="MQSI_unmoved",
        text=f"MQSI is the same in all columns (within {MQSI_UNMOVED.value:g})",
        source="Table III",
        cases=FEASIBLE,
        judge=_MQSI_unmoved,
        measures=("MQSI",),
    ),
    _claim(
        name="headroom_used_up",
        text="below 200 kW the headroom of the others is used up",
        source=SOURCE,
        figure="intermittency",
        cases=(INFEASIBLE,),
        judge=_infeasible,
        measures=("p",),  # the frequency falls: that is the claim
    ),
)
"""Claims of the intermittency experiment."""
