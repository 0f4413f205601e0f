"""Bridges to other programs: feeders written for them, and simulators in place of our plant, found by entry points."""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
