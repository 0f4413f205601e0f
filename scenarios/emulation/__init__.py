"""Emulated links and agents in a run: netem in front of the cores, processes that have it, and what they report."""
