"""The plant: feeder, network, inverter dynamics, and the process that runs them."""
