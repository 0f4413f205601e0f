"""Studies of many runs: sweeps, comparisons, predictions."""
