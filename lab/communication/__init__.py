"""Checks of what the agents said, heard and used, from the record of a run."""
