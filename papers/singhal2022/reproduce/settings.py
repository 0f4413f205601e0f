"""Settings that the paper does not print and we had to choose, from the scenarios as run, each with its reason."""

from __future__ import annotations

from gridpeers.theory import ScenarioModel


def settings(scenarios: dict[str, ScenarioModel]) -> list[tuple[str, str, str]]:
    """Return each setting, its value with the unit, and its reason, for the scenarios of a report.

    Parameters
    ----------
    scenarios : dict[str, ScenarioModel]
        By name of the part.
    """
    first = next(iter(scenarios.values()))
    gains, time, gfm, gfl = first.gains, first.time, first.plant.gfm, first.plant.gfl
    sets: dict[str, list[str]] = {}
    for name, scenario in scenarios.items():
        sets.setdefault(scenario.plant.load_set, []).append(name)
    rows = [
        (
            "places of inverters, capacitors, loads",
            f"feeder {first.plant.feeder}",
            "the paper names the IEEE 123-node feeder, but not the buses; plant/data/README.md tells ours",
        ),
        (
            "load set",
            "; ".join(f'"{load_set}" in {", ".join(names)}' for load_set, names in sets.items()),
            '"event2" drops 1.35 MW at event 2; 0.14 and 0.07 Hz of Table I together imply 1.365 MW; "main" lets '
            "each microgrid stand alone",
        ),
        ("first P_set", f"{first.plant.P_set0_pu:g} pu", "follows from Table I by algebra: 0.65 pu on every unit"),
        (
            "control period T_c",
            f"{time.T_c_s:g} s",
            "f, MPSI and V_error do not depend on it, MQSI and speed do: docs/reproduction.md has 5 to 100 ms",
        ),
        ("k_p", f"{gains.k_p:g} s", 'm_p / k_p = 14 1/s: the speed that "in less than 1 s" asks for'),
        (
            "k_q, alpha, beta",
            f"{gains.k_q:g}, {gains.alpha:g}, {gains.beta_GFM:g}",
            "the simplest choice that settles vars within some seconds; the paper's (14) has no weight",
        ),
        (
            "limits of P_set",
            f"{gains.P_set_min:g} to {gains.P_set_max:g} pu",
            "the paper has none and accepts wind-up (Remark 2); they act below 200 kW only, see wind-up",
        ),
        (
            "filters",
            f"GFM {gfm.R_f:g} + j{gfm.X_f:g} pu, GFL {gfl.R_f:g} + j{gfl.X_f:g} pu",
            "usual values of GridLAB-D's models",
        ),
        ("limit of the GFM", f"{gfm.P_max:g} pu", "follows from the 0.08 Hz of cases II and III in Table I"),
        (
            "apparent power of the GFL",
            f"{gfl.S_max:g} pu",
            "at 1.0 pu nothing would be left for vars above 0.95 pu of real power",
        ),
        (
            "lags of the GFL",
            f"P {gfl.T_pf:g} s, Q {gfl.T_qf:g} s, V {gfl.T_vf:g} s, f {gfl.T_ff:g} s",
            "GridLAB-D's defaults for P are too slow for consensus within 1 s",
        ),
    ]
    reduced = scenarios.get("reduced-communication")
    if reduced is not None:
        own = reduced.cases["reduced"].gains
        rows.append(
            (
                "re-tuned alpha, beta",
                f"{own.alpha:g}, {own.beta_GFM:g}",
                "the best of a grid of 30 points by a rule fixed before (docs/reproduction.md)",
            )
        )
    return rows
