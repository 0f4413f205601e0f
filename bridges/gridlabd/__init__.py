"""GridLAB-D as the plant: a feeder as its model, its delta mode stepped from outside, and the interface of a plant."""
