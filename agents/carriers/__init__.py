"""What carries a law: a Python class, a program on standard input and output, an FMU. Not pure."""
