"""Our tables as a model of GridLAB-D, and what it cannot represent."""
