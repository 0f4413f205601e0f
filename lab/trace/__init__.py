"""The messages of a run on one time axis: a Perfetto trace, and flows for a space-time diagram (docs/trace.md)."""
