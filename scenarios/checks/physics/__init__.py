"""Checks of what the plant recorded: frequency, voltage, sharing, loading, oscillation, balance."""
