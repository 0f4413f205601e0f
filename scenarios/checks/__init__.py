"""Checks: named judgements of every run, with limits in the scenario; registered as metrics are (docs/checks.md)."""
