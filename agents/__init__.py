"""The agents: the secondary law, the communication graph, one agent's state, its Zenoh driver."""
