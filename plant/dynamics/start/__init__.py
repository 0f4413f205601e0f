"""The start of a run: its operating point, and inverters that rest there."""
