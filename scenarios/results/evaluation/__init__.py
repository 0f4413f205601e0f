"""Evaluation of a run: metrics, benchmarks and claims, of gridpeers and of users, in the same registries."""
