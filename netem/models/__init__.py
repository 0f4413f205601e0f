"""The faults: frozen structs with units in their keys, and what each does to a message, pure. A file for each family.

A model says what may be written (annotations, `relations`), its law, and how it is drawn (`sampler`, from a `Stream`).
What a random model draws is a function of the message's number alone; see `netem.draws`.
"""

INSTANT = 1e-9
"""Times closer than this (s) are the same: ticks k T_c and the times of a scenario are not exact in binary."""
