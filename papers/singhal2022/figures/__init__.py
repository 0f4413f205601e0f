"""Figures of the paper that are of no single run."""
