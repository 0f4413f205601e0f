"""What theory says of a scenario, part by part; `gridpeers.predict` has all of it for one case (docs/theory.md).

The functions take what a scenario holds: its keys as typed values (`Scenario.spec`) and its feeder (`Scenario.feeder`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gridpeers.rooms import ROOMS

if TYPE_CHECKING:
    from gridpeers.lab.predict.theory_parts import *  # noqa: F403
else:

    def __getattr__(name: str) -> Any:
        """Return a part, which a room above the face brings."""
        return getattr(ROOMS.resolve("theory"), name)
