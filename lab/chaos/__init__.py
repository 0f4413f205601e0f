"""Chaos: random schedules of disturbances, runs judged by checks, failures shrunk (docs/how-to/chaos.md)."""
