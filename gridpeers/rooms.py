"""What the rooms above the face bring to it, by name: entry points of the group "gridpeers.rooms".

The face and what is below it import no room, so that each may be missing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gridpeers.wire.plugins.registry import Registry

ROOMS: Registry[Callable[..., Any]] = Registry(
    "function of a room", "rooms", lambda it: "" if callable(it) else "it cannot be called"
)
"""Functions by name."""
