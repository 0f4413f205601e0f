"""Commands, one or a few that belong together a file. What one needs is imported when it is used."""
