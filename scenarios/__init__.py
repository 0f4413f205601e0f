"""Scenarios and everything around a run: specification, drivers, recording, metrics, plots, command line."""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
