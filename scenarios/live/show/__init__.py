"""What there is to see of a run, and how it is shown: `status` as text, `watch` as a live table."""
