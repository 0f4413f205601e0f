"""Metrics and claims: those of gridpeers and one's own, found by the same registries."""
