"""The paper's law, (12)-(15), as a program without gridpeers; docs/how-to/law-programs.md describes its lines of JSON.

    [case.IV]
    law = { command = ["python3", "paper_law.py"], k_p = 0.0007 }

It keeps the order of operations of agents/laws/consensus.py, so the history is the same to the byte.
"""

import json
import sys
from math import exp

DEFAULTS = {
    "k_p": 0.0007, "k_q": 0.25, "alpha": 1.0, "beta_GFM": 1.0, "beta_GFL": 1.0, "alpha_min": 0.0, "V_full": 0.0,
    "kappa_c": 0.0, "P_set_min": 0.0, "P_set_max": 1.0, "V_set_min": 0.9, "V_set_max": 1.1,
}  # fmt: skip


def towards(rate: float, d: float, T: float) -> float:
    """Return the part of the way to the neighbours' mean in one period."""
    return 0.5 * (1.0 - exp(-2.0 * rate * d * T))


def step(g: dict, own: dict, neighbours: list, T: float) -> tuple[float, float]:
    """Return P_set and V_set (pu) of the next period, from the parameters g."""
    y = z = d = 0.0
    for other in neighbours:  # not by sum(), which rounds otherwise since Python 3.12
        y += other["weight"] * other["m_p"] * other["P_set"]
        z += other["weight"] * other["m_q"] * other["Q"]
        d += other["weight"]
    y_bar, z_bar = (y / d, z / d) if d else (0.0, 0.0)
    if d and g["kappa_c"]:
        d = d / len(neighbours)

    kappa = own["m_p"] / g["k_p"]
    change = towards(g["kappa_c"] or kappa, d, T) * (y_bar - own["m_p"] * own["P_set"])
    if own["leader"] and -own["e"] * own["P_saturated"] <= 0.0:
        change -= (1.0 - exp(-kappa * T)) * own["e"]
    P_set = min(max(own["P_set"] + change / own["m_p"], g["P_set_min"]), g["P_set_max"])

    alpha, beta = 0.0, g["beta_GFL"]
    if own["leader"]:
        alpha, beta = g["alpha"], g["beta_GFM"]
        if g["V_full"] > 0.0:
            alpha = max(g["alpha_min"], alpha * min(1.0, abs(own["V"] - 1.0) / g["V_full"]))
    if alpha > 2.0 * (beta * d):
        b = 1.0 - exp(-alpha * T / g["k_q"])
        a = b * (beta * d) / alpha
    else:
        a = towards(beta / g["k_q"], d, T)
        b = a * alpha / (beta * d) if beta * d > 0.0 else 0.0
    change = -a * (own["z"] - z_bar)
    if own["leader"]:
        change -= b * (own["V"] - 1.0)
    V_set = min(max(own["V_set"] + change, g["V_set_min"]), g["V_set_max"])
    return P_set, own["V_set"] if (V_set - own["V_set"]) * own["V_saturated"] > 0.0 else V_set


def main() -> None:
    """Answer every line of standard input with one on standard output."""
    g = DEFAULTS
    for line in sys.stdin:
        asked = json.loads(line)
        if asked["type"] == "start":
            unknown = sorted(asked["parameters"].keys() - DEFAULTS.keys())
            g = DEFAULTS | asked["parameters"]
            answer = {"error": f"unknown parameters: {', '.join(unknown)}"} if unknown else {"type": "ready"}
        else:
            P_set, V_set = step(g, asked["own"], asked["neighbours"], asked["T"])
            answer = {"P_set": P_set, "V_set": V_set}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
