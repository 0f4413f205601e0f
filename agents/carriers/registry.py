"""The registry of laws: what a scenario may name in `law`."""

from __future__ import annotations

import inspect
from typing import Any

from agents.laws.law import Law
from wire.parameters import parameters_of
from wire.registry import Registry


def _objection(it: Any) -> str:
    if not (isinstance(it, type) and issubclass(it, Law)):
        return "derive a class from gridpeers.Law"
    if it.step is Law.step:
        return "it has no method step(self, own, neighbours, T)"
    try:
        inspect.signature(it.step).bind(None, None, (), 0.02)
    except TypeError as error:
        return f"write its method step(self, own, neighbours, T): {error}"
    try:
        parameters_of(it)
    except TypeError as error:
        return str(error)
    return ""


LAWS: Registry[type[Law]] = Registry(
    "law",
    "laws",
    _objection,
    own={
        "consensus": "agents.laws.consensus:Consensus",
        "dapi": "agents.laws.dapi:Dapi",
        "event-triggered": "agents.laws.event_triggered:EventTriggered",
        "finite-time": "agents.laws.finite_time:FiniteTime",
        "centralised": "agents.laws.centralised:Centralised",
    },
)
"""Laws by name; those of gridpeers come first."""
