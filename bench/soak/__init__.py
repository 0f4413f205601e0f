"""A soak: a live run of the paper's feeder by the clock, with plug-n-play, kills, cuts and heals all the time."""
