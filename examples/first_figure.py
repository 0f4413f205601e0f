"""First figure: an islanding on droop alone, and under a law of your own that restores the frequency.

python examples/first_figure.py
"""

import gridpeers as gp


class Restore(gp.Law):
    """Integrate the own frequency error, and go half of the way to the neighbours' mean set-point."""

    def step(self, own, neighbours, T):
        mean = sum(n.P_set for n in neighbours) / len(neighbours) if neighbours else own.P_set
        P_set = own.P_set + (mean - own.P_set) / 2 - T / 0.2 * own.e / own.m_p
        return gp.SetPoints(P_set, own.V_set)


restore = {"secondary": "all", "graph": "full", "law": Restore, "title": "my law"}
scenario = gp.load("islanding")  # it loses the grid at 1 s, and a third of its load at 4 s
runs = scenario.replace({"case.restore": restore, "paper": ""}).run(["I", "restore"])
print(runs.metrics[["f_error_Hz", "MPSI", "t_restore_s"]].round(3))

for case, result in runs.items():
    f = result.history["inv1"]["f"]  # Hz; columns (inverter, quantity) over time
    print(f"case {case}: inv1 falls to {f.min():.2f} Hz and ends at {f.iloc[-1]:.2f} Hz")

runs.plot().savefig("first_figure.png")
print("drawn: first_figure.png")
