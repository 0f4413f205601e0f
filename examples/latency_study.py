"""Latency study: what delay on the links between agents does to control, by a metric of our own.

python examples/latency_study.py
"""

import numpy as np
import pandas as pd

import gridpeers as gp

DELAYS = [0.0, 0.02, 0.05, 0.1, 0.2]  # s


def overshoot(history: pd.DataFrame) -> float:
    """Return how far a set-point of P goes beyond its last value after islanding, at worst (pu of that value)."""
    P_set = history.xs("P_set", axis="columns", level="quantity").loc[1.0:3.99]
    return float(np.max(P_set.max() / P_set.iloc[-1]) - 1.0)


every_link = {"case.IV.link": [{"on": "* <-> *", "delay": 0.0}]}
table = gp.sweep(
    gp.load("islanding").replace(every_link),
    {"case.IV.link[0].delay": DELAYS},
    cases=["IV"],
    metrics=["t_restore_s"],
    histories=True,
)
table["overshoot"] = table.pop("history").map(overshoot)
print(table.drop(columns=["case", "seed", "status", "why"]).round(3).to_string(index=False))

limits = gp.predict(gp.load("islanding"), "IV", voltage=False).delay_limits
print("\nWhat theory says of the longest delay (s):", limits.round(3), sep="\n")
