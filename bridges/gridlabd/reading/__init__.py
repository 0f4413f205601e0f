"""Feeders written for GridLAB-D: it solves the model, we take over its admittances and loads."""
