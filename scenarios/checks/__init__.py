"""Checks: judgements of every run by name, with limits in the scenario (docs/reference/measures-and-checks.md)."""
