"""Communication graphs: random connected ones, and what a rule of the scenario makes of nameplates."""

from __future__ import annotations

from gridpeers.agents.agent_config import Control
from gridpeers.agents.graphs import adjacency
from gridpeers.scenarios.sweep.axes import Edges, algebraic_connectivity, connected_graph, connected_graphs

__all__ = [
    "Control",
    "Edges",
    "adjacency",
    "algebraic_connectivity",
    "connected_graph",
    "connected_graphs",
]
