"""The plant in wall-clock time: it keeps its pace, whoever comes and goes. Pure."""

from plant.freerun.core import LEAD, FreePlant

__all__ = ["LEAD", "FreePlant"]
