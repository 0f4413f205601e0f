"""Faults of links in words."""

from __future__ import annotations

from typing import Any

import msgspec

from gridpeers.netem.models.delay import Constant, Uniform
from gridpeers.netem.models.loss import Bernoulli
from gridpeers.netem.models.medium import Cut, Rate
from gridpeers.netem.schema.fault import PROFILES
from gridpeers.wire.plugins.plugin import Plugin


def words(kind: str, model: Any) -> str:
    """Return a fault in words: plain if it has one or two numbers, else the profile that has it, or its keys.

    Parameters
    ----------
    kind : str
        Of `gridpeers.netem.schema.fault.KINDS`, or "partition".
    model : Any
        The struct of `gridpeers.netem.models`.

    Examples
    --------
    >>> words("delay", Uniform(low_s=0.08, high_s=0.12))
    'delay 0.08 to 0.12 s'
    >>> from gridpeers.netem.models.delay import Normal
    >>> words("delay", Normal(mean_s=0.05, std_s=0.02, correlation=0.5))
    'delay normal (correlation 0.5, mean_s 0.05, std_s 0.02)'
    >>> words("loss", PROFILES["lte"].loss)
    'loss of lte'
    """
    match model:
        case Plugin(parameters=parameters):
            keys = [f"{name} {_shown(value)}" for name, value in parameters]
            return f"{kind} ({', '.join(keys)})" if keys else kind
        case Cut(hold=hold):
            return f"{kind}, messages kept" if hold else kind
        case Constant(delay_s=delay, fifo=False):
            return f"{kind} {delay:g} s"
        case Uniform(low_s=low, high_s=high, fifo=False, correlation=0.0):
            return f"{kind} {low:g} to {high:g} s"
        case Bernoulli(p=p):
            return f"{kind} {p:g}"
        case Rate(bytes_per_s=rate):
            return f"{kind} {rate:g} bytes/s"
    for name, profile in PROFILES.items():
        if getattr(profile, kind, None) == model:
            return f"{kind} of {name}"
    fields = msgspec.structs.fields(model)
    given = [(field.name, getattr(model, field.name), field.default) for field in fields]
    keys = [f"{name} {_shown(value)}" for name, value, default in given if value != default]
    if fields[0].name == "p" and len(keys) == 1:
        return f"{kind} {keys[0].removeprefix('p ')}"
    model_name = model.__struct_config__.tag
    return f"{kind} {model_name} ({', '.join(keys)})" if model_name else f"{kind} ({', '.join(keys)})"


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value) if not isinstance(value, tuple) else "..."
