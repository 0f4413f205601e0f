"""Our claims on limits of set-points, beside the paper's Remark 2, which accepts wind-up."""

from __future__ import annotations

from gridpeers.benchmarks import Findings
from gridpeers.papers.singhal2022.claims.experiment_claims import ExperimentClaims, listed, seconds
from gridpeers.papers.singhal2022.tolerances import WITHIN

CASES = ("none", "clamp", "conditional")
SUN, CLOUDS = "sun", "clouds"
"""Labels of the events in the scenario: power is short from the one on, and there again from the other on."""

claims = ExperimentClaims("wind-up", source="ours, on Remark 2", figure="wind-up", cases=CASES)


@claims.add("set-points without limits hold the frequency up while power is short", events=(CLOUDS,))
def wind_up_holds_frequency_up(found: Findings) -> tuple[bool, str]:
    errors = {case: found.results[case][CLOUDS].f_error_Hz for case in CASES}  # not steady: the frequency falls
    shown = listed((case, f"{error:.2f}") for case, error in errors.items())
    return errors["none"] < min(errors["clamp"], errors["conditional"]), f"abs(f-60) {shown} Hz"


@claims.add("with limits f and sharing are back within 1 s when power is, and sooner than without", events=(SUN,))
def limits_restore_sooner(found: Findings) -> tuple[bool, str]:
    times = {case: found.results[case][SUN].t_restore_s for case in CASES}
    free, *limited = times.values()
    known = [t for t in limited if t is not None and t <= WITHIN.value]
    holds = len(known) == 2 and (free is None or free > max(known))
    return holds, listed((case, seconds(t)) for case, t in times.items())
