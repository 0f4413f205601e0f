"""Scenarios and everything around a run: specification, drivers, recording, metrics, plots, command line."""
