"""GridLAB-D as the reference: runs that both plants go through step by step."""
