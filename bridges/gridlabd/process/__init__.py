"""GridLAB-D in a process of its own: what it is asked, and what it complains of."""
