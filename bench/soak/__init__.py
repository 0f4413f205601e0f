"""A soak: a live run of the paper's feeder by the clock, with plug-n-play, kills, cuts and heals all the time.

`python -m bench.soak` starts the processes, disturbs the run every few seconds, and judges memory, files, late steps,
heals and frequency. docs/reliability.md has the result of an hour.
"""
