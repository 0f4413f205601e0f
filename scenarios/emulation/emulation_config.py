"""The configuration of a run's emulated links and nodes, which every process of the run starts with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from gridpeers.netem.schema.netem import Netem


class EmulationConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The run's faults, and the microgrids that their patterns name."""

    netem: Netem
    """All entries; a partition by island is resolved already."""
    microgrids: dict[str, str]
    """Microgrid of every inverter, spare ones too, in the order of their table."""
    real_nodes: bool = False
    """Whether processes are really killed and paused, as in wall-clock time; else that is emulated."""
    keep_trace: bool = True
    """Whether every verdict is reported, not only their counts and their hash."""

    def to_tree(self) -> dict[str, Any]:
        """Return it as the tree `links` of `AgentConfig` and `PlantConfig`, whose packages know no netem."""
        tree: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return tree

    @classmethod
    def of_tree(cls, tree: Mapping[str, Any]) -> EmulationConfig:
        """Return the configuration in a tree; raise msgspec.ValidationError if the tree is none."""
        return msgspec.convert(tree, type=cls)
