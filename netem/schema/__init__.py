"""Links and nodes in a scenario file: entries, patterns, profiles, and all their problems at once."""
