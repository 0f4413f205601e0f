"""What the rooms above the face bring to it, by name: entry points of the group "gridpeers.rooms".

The face and what is below it import no room, so that each may be missing.
"""

from __future__ import annotations

from typing import Any

from gridpeers.wire.plugins.registry import Registry

ROOMS: Registry[Any] = Registry("part of a room", "rooms", lambda it: "")
"""Functions, classes and modules by name."""
