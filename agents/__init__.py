"""Agents: control laws, the communication graph, and one agent's state, node and process."""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
