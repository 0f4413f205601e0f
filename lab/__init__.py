"""Studies of runs beside the core: what a scenario or a person asks for, registered by entry points."""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
