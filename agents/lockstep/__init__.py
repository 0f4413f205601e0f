"""The agent in simulated time: it finds the others, waits for what a tick needs, and computes it. Pure."""

from agents.lockstep.core import AgentSide

__all__ = ["AgentSide"]
