"""Why an agent decided as it did, from the record of its run (docs/why.md)."""
