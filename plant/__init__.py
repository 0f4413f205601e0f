"""The plant: feeder, network, inverter dynamics, and the process that runs them."""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
