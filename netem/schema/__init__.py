"""What a scenario file says about links and nodes: entries, patterns, profiles, and all of their problems at once."""
