"""HELICS: a plant that a federate of others simulates, and our plant for federates of others (docs/helics.md)."""
