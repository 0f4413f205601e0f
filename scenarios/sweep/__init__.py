"""Sweeps: one scenario run many times over values of its keys, random draws, graphs and seeds, into one table."""
