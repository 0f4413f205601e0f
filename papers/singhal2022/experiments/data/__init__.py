"""What an experiment is made from: the rows of a sweep, or the histories of a scenario."""
