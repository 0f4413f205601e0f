"""Studies of runs beside the core: what a scenario or a person asks for, registered by entry points."""
