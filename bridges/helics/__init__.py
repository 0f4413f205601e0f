"""HELICS: a plant that a federate of others simulates (docs/how-to/cosimulation.md)."""
