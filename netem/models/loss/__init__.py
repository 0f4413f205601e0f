"""Losses of single messages."""

from netem.models.loss.bernoulli import Bernoulli
from netem.models.loss.gilbert_elliott import GilbertElliott
from netem.models.loss.loss_model import LossModel
from netem.models.loss.markov import Markov

AnyLoss = Bernoulli | GilbertElliott | Markov
"""Every loss a scenario may name."""

__all__ = ["AnyLoss", "Bernoulli", "GilbertElliott", "LossModel", "Markov"]
