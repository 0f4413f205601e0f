"""The registry of laws: what a scenario may name in `law`."""

from __future__ import annotations

import inspect
from typing import Any

from agents.laws.law import Law
from wire.parameters import parameter_objection
from wire.registry import Registry

CARRIERS = ("use", "command", "fmu")
"""Keys of a scenario's table `law`, one of which says what the law is."""

KEYS = (*CARRIERS, "folder", "time_limit_s")
"""Keys of the table `law` that are no parameters of the law."""

METHODS = ("start", "close")
"""What an agent calls of a law, beside `step`."""


def _objection(it: Any) -> str:
    if not (isinstance(it, type) and issubclass(it, Law)):
        return "derive a class from gridpeers.Law"
    if it.step is Law.step:
        return "it has no method step(self, own, neighbours, T)"
    try:
        inspect.signature(it.step).bind(None, None, (), 0.02)
    except TypeError as error:
        return f"write its method step(self, own, neighbours, T): {error}"
    if method := next((name for name in METHODS if not callable(getattr(it, name))), ""):
        return f"its {method} is no method; give the parameter another name"
    return parameter_objection(it, KEYS)


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
