"""Latency study: the effect of delay on the links between agents, with a metric of your own.

python examples/latency_study.py
"""

import numpy as np

import gridpeers as gp

DELAYS = [0.0, 0.05, 0.2]  # s


@gp.metric("swing_pu")
def swing(window: gp.WindowData) -> float:
    """Return the largest movement of a P set-point in the last second of a window (pu of its rating)."""
    late = window.t > window.end - 1.0
    return float((np.ptp(window.P_set[late], axis=0) / window.nameplates.s).max())


every_link = {"case.IV.link": [{"on": "* <-> *", "delay": 0.0}]}
table = gp.sweep(
    gp.load("islanding").replace(every_link),
    {"case.IV.link[0].delay": DELAYS},
    cases="IV",
    metrics=["t_restore_s", swing],
)
print(table.drop(columns=["case", "seed", "status", "why", "metric_warnings"]).round(4).to_string(index=False))

limits = gp.predict(gp.load("islanding"), "IV", voltage=False).delay_limits
print("\nLongest delay for which the case is stable, by theory (s):", limits.round(3), sep="\n")
