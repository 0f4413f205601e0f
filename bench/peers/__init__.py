"""Ours beside its peers, all in one run: GridLAB-D, HELICS, ZeroMQ and bare Zenoh."""
