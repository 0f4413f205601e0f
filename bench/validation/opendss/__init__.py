"""OpenDSS as a rival: its two engines, a feeder of our tables as its script."""
