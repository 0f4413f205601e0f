"""What becomes of a run: its folder, its measures and claims, its plots and its report."""
