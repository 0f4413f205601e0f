"""The state of a live run and its views: `status` as text, `watch` as a live table."""
