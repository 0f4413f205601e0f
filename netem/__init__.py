"""Faults of links: delay, loss, duplicates, corruption, rate, slots, cuts.

The pure core imports no clock, no socket and no file, and neither numpy nor scipy: agents' processes start fast.
docs/reference/link-faults.md has every model with its formula, keys and units.
"""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
