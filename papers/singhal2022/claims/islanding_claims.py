"""What the paper claims of its islanding experiment (its section 4, Tables I and II, five figures)."""

from __future__ import annotations

from functools import partial

from gridpeers.benchmarks import Claim, Findings, Judge, Quantity
from papers.singhal2022.claims.claim_columns import by_event, near_relatively, near_the_table, ratio, seconds
from papers.singhal2022.tolerances import F_NONE, FIVE_TIMES, IDLE, IV_MQSI, WITHIN

CASES = ("I", "II", "III", "IV")
EVENTS = ("event1", "event2")
"""Cases and events of the experiment."""


def _only_IV_restores(found: Findings) -> tuple[bool, str]:
    errors = {case: found.results[case]["event1"].f_error_Hz for case in CASES}
    holds = errors["IV"] < F_NONE.value and all(errors[case] >= F_NONE.value for case in ("I", "II", "III"))
    return holds, "abs(f-60) " + ", ".join(f"{case} {error:.3f}" for case, error in errors.items()) + " Hz"


def _IV_within_1_s(found: Findings) -> tuple[bool, str]:
    times = [found.results["IV"][event].t_restore_s for event in EVENTS]
    return all(t is not None and t <= WITHIN.value for t in times), by_event(EVENTS, map(seconds, times))


def _GFL_idle(found: Findings) -> tuple[bool, str]:
    off = {
        case: max(abs(found.results[case]["event2"].p[name] - found.P_set0) for name in found.GFL)
        for case in ("II", "III")
    }
    return max(off.values()) < IDLE.value, ", ".join(f"{case} within {value:.4f} pu" for case, value in off.items())


def _MQSI_order(found: Findings) -> tuple[bool, str]:
    rows = [[found.results[case][event].MQSI for case in ("II", "III", "IV")] for event in EVENTS]
    shown = (" / ".join(f"{x:.2f}" for x in row) for row in rows)
    return all(II >= III > IV for II, III, IV in rows), by_event(EVENTS, shown)


def _IV_shares_vars(found: Findings) -> tuple[bool, str]:
    values = [found.results["IV"][event].MQSI for event in EVENTS]
    return max(values) <= IV_MQSI.value, by_event(EVENTS, (f"{x:.3f}" for x in values))


def _IV_5_times_below_II_and_III(found: Findings) -> tuple[bool, str]:
    results = found.results
    ratios = [ratio(results[case][event].MQSI, results["IV"][event].MQSI) for case in ("II", "III") for event in EVENTS]
    return min(ratios) >= FIVE_TIMES.value, f"least ratio {min(ratios):.1f}"


def _IV_5_times_better_than_I(quantity: Quantity) -> Judge:
    def compare(found: Findings) -> tuple[bool, str]:
        ratios = [ratio(*(getattr(found.results[case][event], quantity) for case in ("I", "IV"))) for event in EVENTS]
        return min(ratios) > FIVE_TIMES.value, by_event(EVENTS, (f"{times:.1f} times" for times in ratios))

    return compare


_claim = partial(Claim, events=EVENTS)
"""What all claims of this experiment have in common, but for those about a whole column of a table."""

ISLANDING: tuple[Claim, ...] = (
    near_the_table("islanding", "I", "f_error_Hz"),
    near_the_table("islanding", "I", "MPSI"),
    near_the_table("islanding", "II", "V_error"),
    near_relatively(
        "islanding",
        "II",
        known_miss="II, event2: 0.000 asks for terminals within 0.0005 pu of nominal, and ours lie up to 0.004 pu from "
        "it; IV: with equal vars they lie 0.003 pu from it, and 3 s after event1 still settle (docs/reproduction.md)",
    ),
    _claim(
        name="only_IV_restores",
        figure="islanding",
        text="only IV restores 60 Hz after event 1",
        source="section 4, Table I",
        cases=("I", "II", "III", "IV"),
        judge=_only_IV_restores,
        measures=("f_error_Hz",),
    ),
    _claim(
        name="IV_within_1_s",
        figure="islanding",
        text="IV: abs(f-60) < 0.01 Hz and MPSI < 0.01 within 1 s",
        source="section 4, figures of f and MPSI",
        cases=("IV",),
        judge=_IV_within_1_s,
        measures=(),
    ),
    _claim(
        name="GFL_idle",
        figure="islanding-power_GFL",
        text="II, III: GFL return to their first power after event 2",
        source="section 4, figure of P",
        cases=("II", "III"),
        judge=_GFL_idle,
        measures=("p",),
    ),
    _claim(
        name="MQSI_order",
        figure="islanding",
        text="MQSI of III lies between those of II and IV",
        source="section 4, Table II",
        cases=("II", "III", "IV"),
        judge=_MQSI_order,
        measures=("MQSI",),
    ),
    _claim(
        name="IV_shares_vars",
        text="IV: MQSI at most 0.1",
        source="Table II (0.04 and 0.05)",
        cases=("IV",),
        judge=_IV_shares_vars,
        measures=("MQSI",),
    ),
    _claim(
        name="IV_5_times_below_II_and_III",
        text="MQSI of IV at least 5 times below those of II and III",
        source="Table II",
        cases=("II", "III", "IV"),
        judge=_IV_5_times_below_II_and_III,
        measures=("MQSI",),
    ),
    _claim(
        name="IV_MQSI_5_times_better_than_I",
        figure="islanding",
        text="IV improves MQSI more than 5 times over I",
        source="section 4, Table II",
        cases=("I", "IV"),
        judge=_IV_5_times_better_than_I("MQSI"),
        measures=("MQSI",),
    ),
    _claim(
        name="IV_V_error_5_times_better_than_I",
        figure="islanding",
        text="IV improves V_error more than 5 times over I",
        source="section 4, Table II",
        cases=("I", "IV"),
        judge=_IV_5_times_better_than_I("V_error"),
        measures=("V_error",),
        known_miss="with equal vars, the terminals of our feeder are 0.003 pu from nominal (docs/reproduction.md)",
    ),
)
"""Claims of the islanding experiment."""
