"""What an experiment comes to: a page of curves and a table, as files."""
