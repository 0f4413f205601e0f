"""GridLAB-D as a rival: runs that both plants go through step by step."""
