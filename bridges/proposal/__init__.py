"""A first islanding of a feeder of one's own: the switch, the inverters, and whether they come to rest."""
