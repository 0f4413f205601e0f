"""The way of a command to a run: its address, access, a session there, and the search for its plant."""
