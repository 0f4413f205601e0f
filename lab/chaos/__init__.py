"""Chaos: schedules of disturbances drawn at random, runs judged by checks, failures shrunk (docs/chaos.md)."""
