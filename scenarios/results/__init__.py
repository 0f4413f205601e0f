"""Results of a run: its folder, its record, its measures and claims, its figures and its report."""
