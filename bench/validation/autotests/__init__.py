"""Cases of GridLAB-D's own autotests, written anew from their parameters: for its delta mode, and for our plant."""
