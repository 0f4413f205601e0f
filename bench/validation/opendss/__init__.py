"""OpenDSS as the reference: its two engines, a feeder of our tables as its script."""
