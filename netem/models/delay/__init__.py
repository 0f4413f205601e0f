"""Delays of single messages."""

from netem.models.delay.constant import Constant
from netem.models.delay.delay_model import DelayModel, RandomDelay
from netem.models.delay.lognormal import Lognormal
from netem.models.delay.normal import Normal
from netem.models.delay.pareto import Pareto
from netem.models.delay.trace import Trace
from netem.models.delay.uniform import Uniform

AnyDelay = Constant | Uniform | Normal | Lognormal | Pareto | Trace
"""Every delay a scenario may name."""

__all__ = [
    "AnyDelay",
    "Constant",
    "DelayModel",
    "Lognormal",
    "Normal",
    "Pareto",
    "RandomDelay",
    "Trace",
    "Uniform",
]
