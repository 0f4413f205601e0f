"""The registry of claims, as a scenario is checked against it; `claim` judges by it."""

from __future__ import annotations

from typing import Any

from wire.plugin_shape import callable_objection
from wire.registry import Registry


def _objection(it: Any) -> str:
    from scenarios.results.claims import Claim  # numpy, which a scenario is read without

    return "" if isinstance(it, Claim) else callable_objection(it, "findings")


CLAIMS: Registry[Any] = Registry("claim", "claims", _objection)
"""Claims by name. Those of a publication come with its benchmark (`scenarios.results.benchmark_registry`)."""
