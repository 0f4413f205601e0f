"""The paper's claims on its islanding experiment (its section 4, Tables I and II, five figures)."""

from __future__ import annotations

from gridpeers import Findings
from gridpeers.measures import Quantity
from gridpeers.papers.singhal2022.experiment_claims import ExperimentClaims, listed, ratio, seconds
from gridpeers.papers.singhal2022.tables import F_NONE, FIVE_TIMES, IDLE, IV_MQSI, WITHIN

CASES = ("I", "II", "III", "IV")
EVENTS = ("event1", "event2")  # Cases and events of the experiment

claims = ExperimentClaims("islanding", events=EVENTS)
claims.column("I", "f_error_Hz")
claims.column("I", "MPSI")
claims.column("II", "V_error")
claims.relative(
    "II",
    known_miss="on our feeder, voltage drops between the inverters leave terminals up to 0.004 pu from nominal; the "
    "paper prints 0.000 for II, event2. In IV they still settle 3 s after event1 (docs/understand/evidence.md)",
)


@claims.add(
    "only IV restores 60 Hz after event 1",
    source="section 4, Table I",
    figure="islanding",
    cases=CASES,
    measures=("f_error_Hz",),
)
def only_IV_restores(found: Findings) -> tuple[bool, str]:
    errors = {case: found.results[case]["event1"].f_error_Hz for case in CASES}
    holds = errors["IV"] < F_NONE and all(errors[case] >= F_NONE for case in ("I", "II", "III"))
    return holds, f"abs(f-60) {listed((case, f'{error:.3f}') for case, error in errors.items())} Hz"


@claims.add(
    "IV: abs(f-60) < 0.01 Hz and MPSI < 0.01 within 1 s",
    source="section 4, figures of f and MPSI",
    figure="islanding",
    cases=("IV",),
)
def IV_within_1_s(found: Findings) -> tuple[bool, str]:
    times = {event: found.results["IV"][event].t_restore_s for event in EVENTS}
    holds = all(t is not None and t <= WITHIN for t in times.values())
    return holds, listed((event, seconds(t)) for event, t in times.items())


@claims.add(
    "II, III: GFL return to their first power after event 2",
    source="section 4, figure of P",
    figure="islanding-power_GFL",
    cases=("II", "III"),
    measures=("p",),
)
def GFL_idle(found: Findings) -> tuple[bool, str]:
    p = {case: found.results[case]["event2"].p for case in ("II", "III")}
    off = {case: max(abs(powers[name] - found.P_set0) for name in found.GFL) for case, powers in p.items()}
    return max(off.values()) < IDLE, listed((case, f"within {value:.4f} pu") for case, value in off.items())


@claims.add(
    "MQSI of III lies between those of II and IV",
    source="section 4, Table II",
    figure="islanding",
    cases=("II", "III", "IV"),
    measures=("MQSI",),
)
def MQSI_order(found: Findings) -> tuple[bool, str]:
    rows = {event: [found.results[case][event].MQSI for case in ("II", "III", "IV")] for event in EVENTS}
    holds = all(II >= III > IV for II, III, IV in rows.values())
    return holds, listed((event, " / ".join(f"{x:.2f}" for x in row)) for event, row in rows.items())


@claims.add("IV: MQSI at most 0.1", source="Table II (0.04 and 0.05)", cases=("IV",), measures=("MQSI",))
def IV_shares_vars(found: Findings) -> tuple[bool, str]:
    values = {event: found.results["IV"][event].MQSI for event in EVENTS}
    return max(values.values()) <= IV_MQSI, listed((event, f"{x:.3f}") for event, x in values.items())


@claims.add(
    "MQSI of IV at least 5 times below those of II and III",
    source="Table II",
    cases=("II", "III", "IV"),
    measures=("MQSI",),
)
def IV_5_times_below_II_and_III(found: Findings) -> tuple[bool, str]:
    least = min(min(_times_below(found, case, "MQSI").values()) for case in ("II", "III"))
    return least >= FIVE_TIMES, f"smallest ratio {least:.1f}"


def _add_5_times_better_than_I(quantity: Quantity, known_miss: str = "") -> None:
    @claims.add(
        f"IV improves {quantity} more than 5 times over I",
        name=f"IV_{quantity}_5_times_better_than_I",
        source="section 4, Table II",
        figure="islanding",
        cases=("I", "IV"),
        measures=(quantity,),
        known_miss=known_miss,
    )
    def better(found: Findings) -> tuple[bool, str]:
        ratios = _times_below(found, "I", quantity)
        holds = min(ratios.values()) > FIVE_TIMES
        return holds, listed((event, f"{times:.1f} times") for event, times in ratios.items())


_add_5_times_better_than_I("MQSI")
_add_5_times_better_than_I(
    "V_error", "with equal vars, voltage drops on our feeder leave 0.003 pu (docs/understand/evidence.md)"
)


def _times_below(found: Findings, case: str, quantity: Quantity) -> dict[str, float]:
    """Return how many times smaller a quantity is in case IV than in another case, by event."""
    return {event: ratio(*(getattr(found.results[name][event], quantity) for name in (case, "IV"))) for event in EVENTS}
