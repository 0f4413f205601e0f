"""Feeders written for OpenDSS: the engine reads the script, we take over its elements."""

from gridpeers.bridges.opendss.read_opendss import read_opendss

__all__ = ["read_opendss"]
