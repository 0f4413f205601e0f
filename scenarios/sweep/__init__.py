"""Sweeps: one scenario run many times over values of its keys, random draws, graphs and seeds, into one table."""

import gridpeers.scenarios.results.plots  # noqa: F401  # before matplotlib, which it keeps from a warning about the user's home
