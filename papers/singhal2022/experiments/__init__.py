"""Experiments on links that are late, lossy or down: one command each to a figure and a table with theory beside.

An experiment is a sweep of the catalogue, or a scenario with histories, and a function from its rows or histories to
a page (`page`) and a table (`table`). docs/experiments.md tells what was found.
"""
