"""The registry of laws: what a scenario may name in `law`."""

from __future__ import annotations

from typing import Any

from gridpeers.agents.laws.law import Law
from gridpeers.wire.plugins.plugin import class_objection
from gridpeers.wire.plugins.registry import Registry

CARRIERS = ("use", "command", "fmu")
"""Keys of a scenario's table `law`, one of which says what the law is."""

KEYS = (*CARRIERS, "folder", "time_limit_s")
"""Keys of the table `law` that are no parameters of the law."""

METHODS = ("start", "close", "terms")
"""Methods of a law that are called beside `step`; a law may leave them as they are in `Law`."""


def _objection(it: Any) -> str:
    if wrong := class_objection(it, Law, "step", ("own", "neighbours", "T"), KEYS):
        return wrong
    method = next((name for name in METHODS if not callable(getattr(it, name))), "")
    return f"its {method} is no method; give the parameter another name" if method else ""


LAWS: Registry[type[Law]] = Registry(
    "law",
    "laws",
    _objection,
    own={
        "consensus": "gridpeers.agents.laws.consensus:Consensus",
        "dapi": "gridpeers.agents.laws.dapi:Dapi",
        "event-triggered": "gridpeers.agents.laws.event_triggered:EventTriggered",
        "finite-time": "gridpeers.agents.laws.finite_time:FiniteTime",
        "centralised": "gridpeers.agents.laws.centralised:Centralised",
        "resilient": "gridpeers.agents.laws.resilient:Resilient",
    },
)
"""Laws by name; those of gridpeers come first."""
