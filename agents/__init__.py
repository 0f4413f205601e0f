"""Agents: control laws, the communication graph, and one agent's state, node and process."""
