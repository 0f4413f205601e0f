"""Carriers of laws: Python classes, programs on standard input and output, FMUs. Not pure."""
