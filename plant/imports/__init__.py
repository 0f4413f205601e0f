"""Feeders from other programs' files."""
