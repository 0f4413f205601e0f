"""Predictions by theory, before a scenario is run: modes, settling times, limits of delay, times after an event."""
