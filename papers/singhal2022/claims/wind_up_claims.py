"""What limits of set-points are worth: ours, beside the paper's Remark 2, which accepts wind-up."""

from __future__ import annotations

from functools import partial

from gridpeers.benchmarks import Claim, Findings
from papers.singhal2022.claims.claim_columns import seconds
from papers.singhal2022.tolerances import WITHIN

CASES = ("none", "clamp", "conditional")
SUN, CLOUDS = "sun", "clouds"
"""Labels of the events in the scenario: power is short from the one on, and there again from the other on."""


def _held_up(found: Findings) -> tuple[bool, str]:
    errors = {case: found.results[case][CLOUDS].f_error_Hz for case in CASES}
    shown = ", ".join(f"{case} {error:.2f}" for case, error in errors.items())
    return errors["none"] < min(errors["clamp"], errors["conditional"]), f"abs(f-60) {shown} Hz"


def _sooner(found: Findings) -> tuple[bool, str]:
    times = {case: found.results[case][SUN].t_restore_s for case in CASES}
    free, *limited = times.values()
    shown = ", ".join(f"{case} {seconds(t)}" for case, t in times.items())
    known = [t for t in limited if t is not None and t <= WITHIN.value]
    return len(known) == 2 and (free is None or free > max(known)), shown


_claim = partial(Claim, source="ours, on Remark 2", figure="wind-up", cases=CASES)
"""What all claims of this experiment have in common."""

WIND_UP: tuple[Claim, ...] = (
    _claim(
        name="wind_up_holds_frequency_up",
        text="set-points without limits hold the frequency up while power is short",
        events=(CLOUDS,),
        judge=_held_up,
        measures=(),  # the frequency falls: that is the claim
    ),
    _claim(
        name="limits_restore_sooner",
        text="with limits f and sharing are back within 1 s when power is, and sooner than without",
        events=(SUN,),
        judge=_sooner,
        measures=(),
    ),
)
"""Claims of our experiment on wind-up."""
