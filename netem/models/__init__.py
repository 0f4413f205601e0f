"""The faults: frozen structs with units in their keys, and their effect on a message. Pure; a file for each family.

A model has the ranges of its keys (annotations, `relations`), its law, and its draws (`sampler`, from a `Stream`).
The draws of a random model depend on the message's number alone; see `gridpeers.netem.draws`.
"""

INSTANT = 1e-9
"""Times closer than this (s) are the same: ticks k T_c and the times of a scenario are not exact in binary."""
