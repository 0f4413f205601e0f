"""Compare a wall-clock run with its scenario, and report the numbers of a live run."""
