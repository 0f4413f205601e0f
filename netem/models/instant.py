"""How far apart two times must be to be two."""

INSTANT = 1e-9
"""Times closer than this (s) are the same: ticks k T_c and the times of a scenario are not exact in binary."""
