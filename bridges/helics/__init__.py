"""HELICS: a plant that a foreign federate simulates (docs/how-to/cosimulation.md)."""
