"""Why an agent decided as it did, from the record of its run (docs/how-to/explain-a-run.md)."""
