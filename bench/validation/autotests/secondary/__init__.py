"""GridLAB-D's secondary-control autotest on IEEE 123: its island, machines and controller, there and in our plant."""
