"""Tick times, drift-free schedules, what a tick waits for, and when a session has failed: pure."""
