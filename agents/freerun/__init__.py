"""The agent in wall-clock time: it ticks on its own timer with what it heard last. Pure."""

from agents.freerun.core import FreeAgent

__all__ = ["FreeAgent"]
