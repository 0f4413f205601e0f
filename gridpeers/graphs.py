"""Communication graphs: random connected ones, and what a rule of the scenario makes of nameplates."""

from __future__ import annotations

from agents.config import Control
from agents.topology import adjacency
from scenarios.sweep.file.graphs import Edges, algebraic_connectivity, connected_graph, connected_graphs

__all__ = [
    "Control",
    "Edges",
    "adjacency",
    "algebraic_connectivity",
    "connected_graph",
    "connected_graphs",
]
