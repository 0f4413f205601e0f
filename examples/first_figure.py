"""First figure: an islanding under four kinds of control, as tables and as a figure.

python examples/first_figure.py
"""

import gridpeers as gp

scenario = gp.load("islanding")  # the grid goes at 1 s, a third of the load at 4 s
for note in scenario.check():
    print(note)

runs = scenario.run()  # all four cases, in this process
print(runs.metrics[["f_error_Hz", "MPSI", "t_restore_s"]].round(3))

history = runs["IV"].history  # columns (inverter, quantity) over time
print(f"inv1 falls to {history['inv1']['f'].min():.2f} Hz and ends at {history['inv1']['f'].iloc[-1]:.2f} Hz")

runs.plot().savefig("first_figure.png")
print("drawn: first_figure.png")
