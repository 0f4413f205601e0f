"""Models of inverters, one a file, and the port through which the plant, its checks and predictions use them."""
