"""What is made of runs, or before them: sweeps, comparisons, predictions."""
