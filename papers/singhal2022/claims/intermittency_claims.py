"""The paper's claims on intermittency: three inverters lose power, the others take over (section 4, Table III)."""

from __future__ import annotations

from gridpeers.benchmarks import Findings
from gridpeers.papers.singhal2022.claims.experiment_claims import ExperimentClaims
from gridpeers.papers.singhal2022.tolerances import AT_LIMIT, EQUAL, F_NONE, HEADROOM_GONE, MQSI_UNMOVED

CLOUDS = "clouds"
"""Label of the event in the scenario."""

FEASIBLE = ("350kW", "275kW", "250kW", "225kW", "200kW")
"""Cases of Table III."""

CUT = FEASIBLE[1:]
"""Those of them in which power is really lost."""

INFEASIBLE = "175kW"
"""Below the table's last column: the others have not enough left."""

claims = ExperimentClaims(
    "intermittency", source="section 4, Table III and figure", figure="intermittency", events=(CLOUDS,)
)
claims.column("III", "MPSI")
claims.column("III", "f_error_Hz")
claims.column("III", "V_error")
claims.relative("III")


@claims.add("inverters 2, 5 and 8 give what they have", cases=CUT, measures=("p",))
def saturated_at_their_limit(found: Findings) -> tuple[bool, str]:
    limits = [(case, name, limit) for case in CUT for name, limit in found.available[case].items()]
    off = max((abs(found.results[case][CLOUDS].p[name] - limit) for case, name, limit in limits), default=float("inf"))
    return off < AT_LIMIT.value, f"at most {off:.4f} pu off their limits"


@claims.add("the others take over alike, and 60 Hz returns", cases=CUT, measures=("f_error_Hz", "p"))
def others_take_over(found: Findings) -> tuple[bool, str]:
    others = [_others(found, case) for case in CUT]
    spread = max(max(p) - min(p) for p in others)
    f_error = max(found.results[case][CLOUDS].f_error_Hz for case in CUT)
    times = [found.settled[case][CLOUDS].t_f_s for case in CUT]
    slowest = max((t for t in times if t is not None), default=float("nan"))
    holds = spread < EQUAL.value and f_error < F_NONE.value and None not in times
    return holds, f"the others within {spread:.4f} pu of each other, f back within {slowest:.2f} s"


@claims.add(
    f"MQSI is the same in all columns (within {MQSI_UNMOVED.value:g})",
    source="Table III",
    figure="",
    cases=FEASIBLE,
    measures=("MQSI",),
)
def MQSI_unmoved(found: Findings) -> tuple[bool, str]:
    values = [found.results[case][CLOUDS].MQSI for case in FEASIBLE]
    return max(values) - min(values) < MQSI_UNMOVED.value, f"MQSI from {min(values):.3f} to {max(values):.3f}"


@claims.add(
    "below 200 kW the headroom of the others is used up",
    cases=(INFEASIBLE,),
    measures=("p",),  # the frequency falls: that is the claim
)
def headroom_used_up(found: Findings) -> tuple[bool, str]:
    least, f_error = min(_others(found, INFEASIBLE)), found.results[INFEASIBLE][CLOUDS].f_error_Hz
    holds = f_error > HEADROOM_GONE.value and least > 1.0 - EQUAL.value
    return holds, f"the others at {least:.3f} pu or more, abs(f-60) {f_error:.2f} Hz and growing"


def _others(found: Findings, case: str) -> list[float]:
    """Return the powers (pu) of the inverters that lose none."""
    return [p for name, p in found.results[case][CLOUDS].p.items() if name not in found.available[case]]
