"""HELICS: a plant that a federate of others simulates (docs/helics.md)."""
