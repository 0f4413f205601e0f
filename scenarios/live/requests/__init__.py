"""Requests to the plant of a run: its status, commands to it, to links and loads, and configurations of agents."""
