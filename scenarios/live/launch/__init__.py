"""The start of a live run from a terminal: options, folders, plant and agents as processes, and the record of it."""
