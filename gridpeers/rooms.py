"""Parts that the rooms above the Python library bring, by name: entry points of the group "gridpeers.rooms".

The library imports no room, so each room may be missing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gridpeers.wire.plugins.registry import Registry

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Tables

ROOMS: Registry[Any] = Registry("part of a room", "rooms", lambda it: "")  # Functions, classes and modules by name

READERS: Registry[Callable[..., Tables]] = Registry(
    "reader of feeders", "feeder readers", lambda it: "" if callable(it) else "it cannot be called"
)
"""Readers of feeders of other programs, by the ending of the file's name without its dot.

Each takes the path and the nominal frequency (Hz) or None, and by name `leave_out` and `switches`.
"""
